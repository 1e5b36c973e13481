// The page in Chromium with WebGL in software: a mouse takes the peg, a wall stops it, a second page
// watches, a tab that is closed lets go. Prints rates and times; frames are not timed, the machine
// draws them by its processor.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdirSync } from "node:fs";
import { once } from "node:events";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";

const root = process.env.PEGFIT_ROOT;
const pictures = process.env.PEGFIT_PICTURES;
const PATIENCE = 60_000;

const children = new Set();
process.on("exit", () => children.forEach((child) => child.kill()));

/** `pegfit play` with its page's address; `end` gives what it said of its loops. */
async function play(...words) {
    const child = spawn(`${root}/target/debug/pegfit`,
        ["play", "--no-open", "--json", ...words], { cwd: root });
    children.add(child);
    let said = "";
    child.stderr.on("data", (text) => { said += text; });
    const [line] = await once(createInterface(child.stdout), "line");
    const end = async () => {
        child.kill("SIGINT");
        const [code] = await once(child, "exit");
        assert.equal(code, 0, said);
        return said.split("\n").filter((text) => text.includes(" Hz over "));
    };
    return { url: JSON.parse(line).url, end };
}

const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM,
    args: ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox",
        "--ignore-gpu-blocklist", "--disable-gpu-compositing"],
});

/** A page that is there; what its console complains of fails the test. */
async function open(url, viewport = { width: 1280, height: 800 }) {
    const context = await browser.newContext({ viewport, deviceScaleFactor: 1 });
    const page = await context.newPage();
    page.complaints = [];
    page.on("console", (message) => {
        if (message.type() === "error") page.complaints.push(message.text());
    });
    page.on("pageerror", (error) => page.complaints.push(error.message));
    page.setDefaultTimeout(PATIENCE);
    await page.goto(url);
    await page.waitForFunction(() => window.pegfit?.stage() && window.pegfit.frame());
    return page;
}

const frame = (page) => page.evaluate(() => window.pegfit.frame());
const size = (v) => Math.hypot(...v);
const wait = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

async function until(page, what, test) {
    const began = Date.now();
    for (;;) {
        const now = await frame(page);
        if (test(now)) return now;
        assert(Date.now() - began < PATIENCE, `${what}: ${JSON.stringify(now)}`);
        await wait(50);
    }
}

/** The mouse takes the part. */
async function grab(page) {
    await page.waitForTimeout(300);
    const [x, y] = await page.evaluate(() => window.pegfit.screen());
    await page.mouse.move(x, y);
    await page.mouse.down();
    return { x, y };
}

/** Drags the part by metres along directions of the scene, slowly. */
async function drag(page, from, metres, steps = 25) {
    const [right, down] = await page.evaluate((to) => {
        const length = Math.hypot(...to);
        return window.pegfit.along(to.map((x) => x / length)).map((pixels) => pixels * length);
    }, metres);
    for (let i = 1; i <= steps; i += 1) {
        await page.mouse.move(from.x + right * i / steps, from.y + down * i / steps);
        await wait(25);
    }
    return { x: from.x + right, y: from.y + down };
}

/** From where the part is to over the entrance, without the way along the axis. */
function beside(now, stage) {
    const away = [0, 1, 2].map((i) => stage.seated[i] - now.object[i]);
    const along = away.reduce((sum, x, i) => sum + x * stage.axis[i], 0);
    return [away.map((x, i) => x - along * stage.axis[i]), along];
}

async function jump(page, place) {
    await page.getByRole("button", { name: place }).click();
    await page.waitForTimeout(700);
}

const shot = async (page, name) => {
    if (!pictures) return;
    mkdirSync(pictures, { recursive: true });
    await page.screenshot({ path: `${pictures}/${name}.png` });
};

const scene = "examples/rectangular.toml";
// The loop alone, then with a page that holds the hand: what the page costs.
for (const stays of [false, true]) {
    const server = await play(scene);
    const page = await open(server.url);
    if (!stays) await page.close();
    await wait(6000);
    console.log(stays ? "with a page:" : "without a page:", ...(await server.end()));
    if (stays) await page.close();
}

const server = await play(scene);
const page = await open(server.url);
const stage = await page.evaluate(() => window.pegfit.stage());
await until(page, "the hand", (now) => now.isHand);
await page.waitForTimeout(500);
await shot(page, "start");
await page.locator("#help-close").click();

// Into the hole: over it, two thirds in, and let go.
let at = await grab(page);
await until(page, "the hold", (now) => now.doing === 1);
let [side, along] = beside(await frame(page), stage);
at = await drag(page, at, side);
await wait(300);
at = await drag(page, at, stage.axis.map((x) => 0.8 * along * x), 50);
await shot(page, "push");
await page.mouse.up();
const seated = await until(page, "the seat", (now) => Math.abs(now.depth - stage.depth) < 1e-3);
await wait(1000);
await shot(page, "seated");
const off = Math.hypot(...[0, 1, 2].map((i) => seated.object[i] - stage.seated[i]));
console.log(`seated ${(1e3 * off).toFixed(2)} mm from the fit after a drag`);
assert(off < 2e-3);

// Seated, the walls of the hole stop it.
await jump(page, "Seated");
const seat = await frame(page);
at = await grab(page);
const across = side.map((x) => 0.02 * x / size(side));
await drag(page, at, across, 40);
await until(page, "the wall", (now) => size(now.force) > 2);
await wait(500);
const held = await frame(page);
await shot(page, "wall");
const moved = (now, from) => size([0, 1, 2].map((i) => now.object[i] - from.object[i]));
console.log(`at a wall: ${size(held.force).toFixed(2)} N, ` +
    `${(1e3 * moved(held, seat)).toFixed(2)} mm off`);
// Of the 20 mm that the mouse went; walls are as soft as two lattice steps of 1 mm.
assert(moved(held, seat) < 3e-3, "through the wall");

// A second page watches.
const second = await open(server.url);
await until(second, "two pages", (now) => now.pages === 2 && !now.isHand && now.isHeld);
await second.waitForTimeout(500);
assert.match(await second.locator("#role").innerText(), /You watch; another page holds the hand/);
assert(await second.locator("#snap").isDisabled());
const before = await frame(second);
const elsewhere = await grab(second);
await drag(second, elsewhere, [0.02, 0, 0.02], 5);
await second.mouse.up();
const after = await frame(second);
assert(moved(after, before) < 1e-3);
console.log("a second page only watches");

// The first is closed in the middle of its push.
assert(size((await frame(second)).force) > 0.5);
await page.close();
const closed = Date.now();
await until(second, "the release", (now) => size(now.force) < 1e-3 && !now.isHeld);
console.log(`a closed tab lets go: no force ${Date.now() - closed} ms later`);
await second.getByRole("button", { name: "Take it" }).click();
await until(second, "the hand", (now) => now.isHand);
await jump(second, "Seated");

// Everything that can be switched on.
await second.locator("#help-close").click();
await second.locator("#home").click();
for (const id of ["skeleton", "gizmo"]) {
    await second.locator(`#${id}`).check();
    await second.waitForTimeout(1500);
    await shot(second, id);
    await second.locator(`#${id}`).uncheck();
}
for (const id of ["section", "slice"]) await second.locator(`#${id}`).check();
await second.locator("#snap").click();
await second.locator("#record").click();
await until(second, "the script", (now) => now.doing === 3 && now.recorded > 4);
await shot(second, "snap");
await second.locator("#record").click();
const [log] = await Promise.all([second.waitForEvent("download"), second.locator("#log").click()]);
assert.equal(log.suggestedFilename(), "pegfit-play.csv");
const [png] = await Promise.all([
    second.waitForEvent("download"), second.locator("#picture").click(),
]);
assert.equal(png.suggestedFilename(), "pegfit-play.png");
await second.locator("#replay").click();
await until(second, "the replay", (now) => now.doing === 4);
await second.locator("#let-go").click();
await second.locator("#dock").click();
await second.getByRole("button", { name: /^Found 1/ }).waitFor();
console.log("found:", (await second.locator("#places").innerText()).split("\n").slice(-6).join(" "));
await second.locator("#collision").click();
await until(second, "the script", (now) => now.doing === 2 && size(now.force) > 1);

const [rate, median, worst] = await second.evaluate(() => window.pegfit.messages());
console.log(`to the page: ${rate} messages a second, ${median.toFixed(1)} ms old in the middle, ` +
    `${worst.toFixed(1)} ms at most`);
assert(rate > 25, `${rate} messages a second`);
assert.deepEqual([...page.complaints, ...second.complaints], []);
await second.close();

// On a telephone.
const small = await open(server.url, { width: 412, height: 880 });
await until(small, "the hand", (now) => now.isHand);
await small.locator("#help-close").click();
await small.waitForTimeout(800);
await shot(small, "small");
assert.equal(await small.evaluate(() => document.documentElement.scrollWidth), 412);
await small.close();
console.log("with several pages, searches and drags:", ...(await server.end()));

// The paper's three pairs, and none but them.
const three = await play();
const chooser = await open(three.url);
await until(chooser, "the hand", (now) => now.isHand);
await chooser.getByRole("button", { name: "combined" }).click();
await until(chooser, "the next pair", (now) => now.stage === 2);
await chooser.waitForFunction(() => window.pegfit.stage());
await chooser.locator("#help-close").click();
await chooser.waitForTimeout(800);
await shot(chooser, "three");
assert.deepEqual(chooser.complaints, []);
await chooser.close();
await three.end();
await browser.close();
console.log("1 passed, 0 failed");
