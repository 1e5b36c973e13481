// The page in Chromium with WebGL in software. Prints rates and times; frames are not timed, the
// machine draws them by its processor.
import { browser } from "./common.mjs";
import { doors } from "./doors.mjs";
import { follows, hands } from "./hands.mjs";
import { local } from "./local.mjs";
import { loading, looks } from "./looks.mjs";
import { report } from "./report.mjs";
import { cost, papers, story, telephone } from "./story.mjs";

const tests = { cost, story, hands, follows, doors, telephone, papers, looks, loading, local, report };
const wanted = process.argv.slice(2);
for (const name of wanted) {
    if (!(name in tests)) throw new Error(`no test ${name}; there are ${Object.keys(tests)}`);
}
// The page that needs no program is built on its own, and the demo takes minutes: they are tested if
// that is asked for.
const usual = Object.keys(tests).filter((name) => name !== "local" && name !== "report");
const chosen = wanted.length > 0 ? wanted : usual;
for (const name of chosen) {
    console.log(`${name}:`);
    await tests[name]();
}
await browser.close();
console.log(`${chosen.length} passed, 0 failed`);
