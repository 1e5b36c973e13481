// How the page looks and what it says: light and dark, on a telephone, while another pair loads, after
// the part was let go, when a page that records is closed.
import assert from "node:assert/strict";
import { drag, frame, grab, open, play, scene, shot, size, until, wait } from "./common.mjs";

/** Elements that stick out of the screen to the right, or whose words are cut off. */
export const sticking = (page) => page.evaluate(() => {
    const width = document.documentElement.clientWidth;
    return [...document.querySelectorAll("body *")]
        .filter((one) => one.checkVisibility() && !one.closest(".table, pre, svg, #labels"))
        .filter((one) => one.getBoundingClientRect().right > width + 0.5)
        .map((one) => `${one.tagName} ${one.id} ${one.className}`);
});

/** Contrast of the words of an element with what is behind them, 1 to 21, as WCAG has it. */
const contrast = (page, selector) => page.evaluate((selector) => {
    const one = document.querySelector(selector);
    const parse = (colour) => colour.match(/[\d.]+/g).map(Number);
    let behind = one;
    while (behind && (parse(getComputedStyle(behind).backgroundColor)[3] ?? 1) < 0.5) {
        behind = behind.parentElement;
    }
    const light = (rgb) => rgb.slice(0, 3).map((c) => c / 255)
        .map((c) => (c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4))
        .reduce((sum, c, i) => sum + [0.2126, 0.7152, 0.0722][i] * c, 0);
    const [a, b] = [getComputedStyle(one).color, getComputedStyle(behind).backgroundColor]
        .map((colour) => light(parse(colour))).sort((x, y) => y - x);
    return (a + 0.05) / (b + 0.05);
}, selector);

export async function looks() {
    const server = await play(scene);
    const page = await open(server.url, { width: 1440, height: 900 }, { colorScheme: "light" });
    await until(page, "the hand", (now) => now.isHand);
    await page.locator("#help-close").click();
    for (const scheme of ["light", "dark"]) {
        await page.emulateMedia({ colorScheme: scheme });
        await wait(400);
        await shot(page, `looks-${scheme}`);
        for (const selector of ["#force", "#felt span", ".chart .force", ".chart .torque",
            ".chart .energy", "#snap", "h1", "#tools label"]) {
            const found = await contrast(page, selector);
            assert(found >= 4.5, `${selector}: contrast ${found.toFixed(1)} where it is ${scheme}`);
        }
    }
    const plots = await page.evaluate(() => [...document.querySelectorAll(".chart .u-over")]
        .map((plot) => plot.clientHeight));
    assert(plots.length === 3 && plots.every((height) => height > 70), `plots ${plots} px high`);
    await letGo(page);
    await events(page);
    await recording(server, page);
    await narrow(server);
    await server.end();
}

/** Who has the part is said when it is let go; numbers have minus signs. */
async function letGo(page) {
    const role = () => page.locator("#role").innerText();
    const at = await grab(page);
    await until(page, "the hold", (now) => now.doing === 1);
    await page.waitForFunction(() =>
        document.getElementById("role").textContent === "You hold the part");
    await drag(page, at, [0.01, 0, 0], 5);
    await page.mouse.up();
    await until(page, "the release", (now) => now.doing === 0);
    await page.waitForFunction(() => document.getElementById("role").textContent.startsWith("Let go"));
    console.log("let go:", await role());
    const { energy } = await frame(page);
    assert(energy < 0, "an energy below zero");
    assert.match(await page.locator("#energy").innerText(), /^\u2212\d/);
}

/** A page that hangs is told so in words, with what to do. */
async function events(page) {
    // No longer than the input of a hand that was just taken settles.
    await wait(1500);
    await page.evaluate(() => {
        const end = performance.now() + 3500;
        while (performance.now() < end);
    });
    await page.waitForFunction(() => /the page was silent, so its hand let go.*Keep this tab in front/s
        .test(document.getElementById("events").textContent));
    const said = await page.locator("#events").innerText();
    assert(!/\bstale\b|\boverrun\b|\d\u00d7/.test(said), said);
    console.log("events:", said.replaceAll("\n", " "));
}

/** A page that records is closed: so ends its recording. */
async function recording(server, page) {
    await page.locator("#record").click();
    await until(page, "the recording", (now) => now.isRecording && now.recorded > 0.2);
    const second = await open(server.url);
    assert((await frame(second)).isRecording, "recorded before its page was closed");
    await page.close();
    const closed = Date.now();
    await until(second, "its end", (now) => !now.isRecording);
    assert(Date.now() - closed < 10_000, "it went on until its tape was full");
    console.log("a recording ends with its page");
    await second.close();
}

/** The smallest of usual telephones: nothing sticks out, the card is seen whole. */
async function narrow(server) {
    for (const scheme of ["light", "dark"]) {
        const phone = await open(server.url, { width: 390, height: 844 },
            { hasTouch: true, isMobile: true, colorScheme: scheme });
        const card = await phone.locator("#help").boundingBox();
        assert(card.y >= 0 && card.y + card.height <= 844, JSON.stringify(card));
        assert(await phone.locator("#help .touch").isVisible());
        assert(!await phone.locator("#help .keys").isVisible());
        await phone.locator("#help-close").tap();
        const [view, tools] = [await phone.locator("#view").boundingBox(),
            await phone.locator("#tools").boundingBox()];
        assert(tools.y >= view.y + view.height - 1, "the bar is over the parts");
        assert.deepEqual(await sticking(phone), []);
        await shot(phone, `looks-phone-${scheme}`);
        assert.deepEqual(phone.complaints, []);
        await phone.close();
    }
    console.log("390 px: nothing sticks out");
}

/** While another pair loads, what is shown is grey and no arrow is left over. */
export async function loading() {
    const server = await play();
    const page = await open(server.url);
    await until(page, "the hand", (now) => now.isHand);
    await page.locator("#help-close").click();
    await page.locator("#collision").click();
    await until(page, "a force", (now) => size(now.force) > 0.5);
    await page.evaluate(() => {
        // Every change until the next pair is there: the numbers' class, arrows, and the numbers.
        window.seen = [];
        const note = () => window.seen.push({
            stale: document.getElementById("felt").classList.contains("stale"),
            faded: document.getElementById("stage").classList.contains("stale"),
            labels: [...document.querySelectorAll("#labels span")].filter((l) => !l.hidden).length,
            force: document.getElementById("force").textContent,
            stage: window.pegfit.stage()?.stage,
        });
        setInterval(note, 10);
        new MutationObserver(note).observe(document.getElementById("felt"), { attributes: true });
    });
    await page.getByRole("button", { name: "combined" }).click();
    await until(page, "the next pair", (now) => now.stage === 2);
    await page.waitForFunction(() =>
        window.pegfit.stage() && !document.getElementById("felt").classList.contains("stale"));
    const seen = await page.evaluate(() => window.seen);
    const stale = seen.filter((one) => one.stale);
    console.log(`grey in ${stale.length} of ${seen.length} looks`);
    assert(stale.length > 0, "nothing is grey while a pair loads");
    assert(stale.every((one) => one.faded && one.labels === 0), JSON.stringify(stale));
    assert.deepEqual(page.complaints, []);
    await page.close();
    await server.end();
}
