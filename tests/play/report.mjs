// The page of `pegfit demo` and a report of `pegfit feel`: nothing sticks out of a telephone, parts are
// seen in space, figures are chosen, a screen for every pair.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { browser, program, root, shot, wait } from "./common.mjs";
import { sticking } from "./looks.mjs";

const PATIENCE = 600_000;

function make(folder, ...words) {
    const done = spawnSync(program, words, { cwd: root, encoding: "utf8", timeout: PATIENCE });
    assert.equal(done.status, 0, done.stderr);
    return folder;
}

async function view(file, width, height, colorScheme) {
    const context = await browser.newContext({ viewport: { width, height }, colorScheme });
    const page = await context.newPage();
    page.complaints = [];
    page.on("console", (message) => {
        if (message.type() === "error") page.complaints.push(message.text());
    });
    page.on("pageerror", (error) => page.complaints.push(error.message));
    await page.goto(`file://${file}`);
    await wait(800);
    return page;
}

/** Different colours in the middle of the parts' picture: an empty one has one. */
const colours = async (page) => {
    const png = await page.locator("canvas").first().screenshot();
    return page.evaluate(async (data) => {
        const image = new Image();
        image.src = `data:image/png;base64,${data}`;
        await image.decode();
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [image.width, image.height];
        const drawing = canvas.getContext("2d");
        drawing.drawImage(image, 0, 0);
        const { data: pixels } = drawing.getImageData(0, 0, image.width, image.height);
        const seen = new Set();
        for (let i = 0; i < pixels.length; i += 4) seen.add(pixels.slice(i, i + 3).join());
        return seen.size;
    }, png.toString("base64"));
};

/** Width of the widest line of small type on the page, as it is shown, pixels. */
const smallest = (page) => page.evaluate(() => Math.min(...[...document.querySelectorAll(".drawn img")]
    .filter((image) => image.checkVisibility())
    .map((image) => image.getBoundingClientRect().width / image.naturalWidth)));

export async function report() {
    const folder = mkdtempSync(join(tmpdir(), "pegfit-report-"));
    make(folder, "demo", "--out", folder, "-q");
    const file = join(folder, "index.html");
    for (const scheme of ["light", "dark"]) {
        for (const [name, width, height] of [["wide", 1440, 900], ["phone", 390, 844]]) {
            const page = await view(file, width, height, scheme);
            assert.deepEqual(await sticking(page), []);
            assert(await colours(page) > 20, "no parts in the picture");
            const pairs = await page.evaluate(() => [...document.querySelectorAll(".pair")]
                .map((pair) => pair.getBoundingClientRect().height));
            console.log(`${name}, ${scheme}: pairs ${pairs.map(Math.round)} px high`);
            assert.equal(pairs.length, 3);
            if (name === "wide") {
                assert(pairs.every((tall) => tall <= height), "a pair is no more than a screen");
                assert(await smallest(page) > 0.85, "figures are shown at their size");
            }
            await page.locator("#rectangular").scrollIntoViewIfNeeded();
            await shot(page, `report-${name}-${scheme}`);
            await page.locator("#rectangular-snap-tab").click();
            assert(await page.locator("#rectangular-snap").isVisible());
            assert(!await page.locator("#rectangular-density").isVisible());
            await page.locator("#rectangular input[type=range]").fill("0");
            assert.match(await page.locator("#rectangular .said").innerText(), /^\u2212\d.* mm in/);
            assert.deepEqual(page.complaints, []);
            await page.close();
        }
    }
    const felt = join(folder, "felt.html");
    make(folder, "feel", join(folder, "rectangular.toml"), "--seconds", "1", "--report", felt, "-q");
    for (const scheme of ["light", "dark"]) {
        for (const [name, width, height] of [["wide", 1440, 900], ["phone", 390, 844]]) {
            const page = await view(felt, width, height, scheme);
            assert(await colours(page) > 20, "no parts in the picture");
            const tall = await page.evaluate(() => document.documentElement.scrollHeight);
            assert(tall < 2 * height, `${tall} px high`);
            await page.locator("#run-energy-tab").click();
            assert(await page.locator("#run-energy").isVisible());
            await page.locator("input[type=range]").fill("1000");
            assert.match(await page.locator(".said").innerText(), /^[01]\.\d\d s, energy .* force/);
            await shot(page, `report-felt-${name}-${scheme}`);
            await page.evaluate(() => document.querySelectorAll("details")
                .forEach((one) => { one.open = true; }));
            assert.deepEqual(await sticking(page), []);
            const type = await page.evaluate(() => Math.min(...[...document.querySelectorAll("svg text")]
                .filter((text) => text.checkVisibility())
                .map((text) => text.getBoundingClientRect().height)));
            assert(type > 10, `type of ${type} px`);
            assert.deepEqual(page.complaints, []);
            await page.close();
        }
    }
    rmSync(folder, { recursive: true });
}
