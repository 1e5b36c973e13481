// What the tests of the page share: the program, a browser, a page, a mouse.
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdirSync } from "node:fs";
import { once } from "node:events";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";

export const root = process.env.PEGFIT_ROOT;
export const program = process.env.PEGFIT;
export const scene = "examples/rectangular.toml";
const pictures = process.env.PEGFIT_PICTURES;
const PATIENCE = 120_000;

const children = new Set();
process.on("exit", () => children.forEach((child) => child.kill()));

/** `pegfit play` with its page's address; `end` gives what it said of its loops. */
export async function play(...words) {
    const child = spawn(program, ["play", "--no-open", "--json", ...words], { cwd: root });
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

export const browser = await chromium.launch({
    executablePath: process.env.CHROMIUM,
    args: ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox",
        "--ignore-gpu-blocklist", "--disable-gpu-compositing"],
});

/** Pixels of a picture per pixel of the page: pictures are kept small. */
const SHRUNK = pictures ? 0.75 : 1;

/** A page that is there; what its console complains of fails the test. */
export async function open(url, viewport = { width: 1280, height: 800 }, more = {}) {
    const context = await browser.newContext({ viewport, deviceScaleFactor: SHRUNK, ...more });
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

export const frame = (page) => page.evaluate(() => window.pegfit.frame());
export const size = (v) => Math.hypot(...v);
export const wait = (milliseconds) => new Promise((done) => setTimeout(done, milliseconds));

export async function until(page, what, test) {
    const began = Date.now();
    for (;;) {
        const now = await frame(page);
        if (test(now)) return now;
        assert(Date.now() - began < PATIENCE, `${what}: ${JSON.stringify(now)}`);
        await wait(50);
    }
}

/** The mouse takes the part. */
export async function grab(page) {
    await page.waitForTimeout(300);
    const [x, y] = await page.evaluate(() => window.pegfit.screen());
    await page.mouse.move(x, y);
    await page.mouse.down();
    return { x, y };
}

/** Drags the part by metres along directions of the scene, slowly. */
export async function drag(page, from, metres, steps = 25) {
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
export function beside(now, stage) {
    const away = [0, 1, 2].map((i) => stage.seated[i] - now.object[i]);
    const along = away.reduce((sum, x, i) => sum + x * stage.axis[i], 0);
    return [away.map((x, i) => x - along * stage.axis[i]), along];
}

export async function jump(page, place) {
    await page.getByRole("button", { name: place }).click();
    await page.waitForTimeout(700);
}

export const shot = async (page, name) => {
    if (!pictures) return;
    mkdirSync(pictures, { recursive: true });
    await page.screenshot({ path: `${pictures}/${name}.png` });
};

/** How far the part is from where it was, metres. */
export const moved = (now, from) => size([0, 1, 2].map((i) => now.object[i] - from.object[i]));
