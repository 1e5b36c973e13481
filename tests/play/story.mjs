// What a person does: the mouse takes the peg, a wall stops it, a second page watches, a tab that is
// closed lets go, everything is switched on.
import assert from "node:assert/strict";
import {
    beside, drag, frame, grab, jump, moved, open, play, scene, shot, size, until, wait,
} from "./common.mjs";

/** The loop alone, then with a page that holds the hand: what the page costs. */
export async function cost() {
    for (const stays of [false, true]) {
        const server = await play(scene);
        const page = await open(server.url);
        if (!stays) await page.close();
        await wait(6000);
        console.log(stays ? "with a page:" : "without a page:", ...(await server.end()));
        if (stays) await page.close();
    }
}

export async function story() {
    const server = await play(scene);
    const page = await open(server.url);
    const stage = await page.evaluate(() => window.pegfit.stage());
    await until(page, "the hand", (now) => now.isHand);
    await page.waitForTimeout(500);
    await shot(page, "start");
    await page.locator("#help-close").click();
    const side = await seat(page, stage);
    await push(page, stage, side);
    const second = await watch(server, page);
    await tools(second);
    assert.deepEqual([...page.complaints, ...second.complaints], []);
    await second.close();
    console.log("with several pages, searches and drags:", ...(await server.end()));
}

/** Into the hole: over it, two thirds in, and let go. Gives the way across. */
export async function seat(page, stage) {
    let at = await grab(page);
    await until(page, "the hold", (now) => now.doing === 1);
    const [side, along] = beside(await frame(page), stage);
    at = await drag(page, at, side);
    await wait(300);
    await drag(page, at, stage.axis.map((x) => 0.8 * along * x), 50);
    await shot(page, "play");
    await page.mouse.up();
    const seated = await until(page, "the seat", (now) => Math.abs(now.depth - stage.depth) < 1e-3);
    await wait(1000);
    await shot(page, "seated");
    const off = size([0, 1, 2].map((i) => seated.object[i] - stage.seated[i]));
    console.log(`seated ${(1e3 * off).toFixed(2)} mm from the fit after a drag`);
    assert(off < 2e-3);
    return side;
}

/** Seated, the walls of the hole stop it, also after the page has hung. */
async function push(page, stage, side) {
    await jump(page, "Seated");
    const seat = await frame(page);
    const at = await grab(page);
    await drag(page, at, side.map((x) => 0.02 * x / size(side)), 40);
    for (const name of ["wall", "wall-again"]) {
        await until(page, "the wall", (now) => size(now.force) > 2);
        await wait(500);
        const held = await frame(page);
        await shot(page, name);
        console.log(`at a wall: ${size(held.force).toFixed(2)} N, ` +
            `${(1e3 * moved(held, seat)).toFixed(2)} mm off`);
        // Of the 20 mm that the mouse went; walls are as soft as two lattice steps of 1 mm.
        assert(moved(held, seat) < 3e-3, "through the wall");
        if (name === "wall") {
            // Too long for a page that is alive: the force is gone, and comes back.
            await page.evaluate(() => {
                const end = performance.now() + 4000;
                while (performance.now() < end);
            });
            await until(page, "the force again", (now) => now.gain === 1);
        }
    }
}

/** A second page watches, and takes the hand when the first is closed in the middle of its push. */
async function watch(server, page) {
    const second = await open(server.url);
    await until(second, "two pages", (now) => now.pages === 2 && !now.isHand && now.isHeld);
    await second.waitForTimeout(500);
    assert.match(await second.locator("#role").innerText(),
        /You watch; another page has the hand/);
    assert(await second.locator("#snap").isDisabled());
    const before = await frame(second);
    const elsewhere = await grab(second);
    await drag(second, elsewhere, [0.02, 0, 0.02], 5);
    await second.mouse.up();
    assert(moved(await frame(second), before) < 1e-3);
    console.log("a second page only watches");
    await until(second, "the push", (now) => size(now.force) > 0.5);
    await page.close();
    const closed = Date.now();
    await until(second, "the release", (now) => size(now.force) < 1e-3 && !now.isHeld);
    console.log(`a closed tab lets go: no force ${Date.now() - closed} ms later`);
    await second.getByRole("button", { name: "Take it" }).click();
    await until(second, "the hand", (now) => now.isHand);
    await jump(second, "Seated");
    return second;
}

/** Everything that can be switched on. */
async function tools(page) {
    await page.locator("#help-close").click();
    await page.locator("#home").click();
    for (const id of ["skeleton", "gizmo"]) {
        await page.locator(`#${id}`).check();
        await page.waitForTimeout(1500);
        await shot(page, id);
        await page.locator(`#${id}`).uncheck();
    }
    for (const id of ["section", "slice"]) await page.locator(`#${id}`).check();
    await page.locator("#snap").click();
    await page.locator("#record").click();
    await until(page, "the script", (now) => now.doing === 3 && now.recorded > 4);
    await shot(page, "play-snap");
    await page.locator("#record").click();
    const [log] = await Promise.all([
        page.waitForEvent("download"), page.locator("#log").click(),
    ]);
    assert.equal(log.suggestedFilename(), "pegfit-play.csv");
    const [png] = await Promise.all([
        page.waitForEvent("download"), page.locator("#picture").click(),
    ]);
    assert.equal(png.suggestedFilename(), "pegfit-play.png");
    await page.locator("#replay").click();
    await until(page, "the replay", (now) => now.doing === 4);
    await page.locator("#let-go").click();
    await page.locator("#dock").click();
    await page.getByRole("button", { name: /^Found 1/ }).waitFor();
    const found = await page.locator("#places .found").first().innerText();
    console.log("found:", found.replaceAll("\n", " "));
    assert.match(found, /prismatic joint, \d+ nats, quality [01]\.\d\d, \u2212/);
    await page.locator("#collision").click();
    await until(page, "the script", (now) => now.doing === 2 && size(now.force) > 1);
    const [rate, median, worst] = await page.evaluate(() => window.pegfit.messages());
    console.log(`to the page: ${rate} messages a second, ${median.toFixed(1)} ms old in the ` +
        `middle, ${worst.toFixed(1)} ms at most`);
    assert(rate > 25, `${rate} messages a second`);
}

/** A screen as small as a telephone's: all there, nothing wider than it. */
export async function telephone() {
    const server = await play(scene);
    const small = await open(server.url, { width: 412, height: 880 });
    await until(small, "the hand", (now) => now.isHand);
    await shot(small, "small-help");
    await small.locator("#help-close").click();
    await small.waitForTimeout(800);
    await shot(small, "play-small");
    assert.equal(await small.evaluate(() => document.documentElement.scrollWidth), 412);
    assert.deepEqual(small.complaints, []);
    await small.close();
    await server.end();
}

/** The paper's three pairs, to choose among. */
export async function papers() {
    const server = await play();
    const page = await open(server.url);
    await until(page, "the hand", (now) => now.isHand);
    await page.getByRole("button", { name: "combined" }).click();
    await until(page, "the next pair", (now) => now.stage === 2);
    await page.waitForFunction(() => window.pegfit.stage());
    await page.locator("#help-close").click();
    await page.waitForTimeout(800);
    await shot(page, "three");
    assert.deepEqual(page.complaints, []);
    await page.close();
    await server.end();
}
