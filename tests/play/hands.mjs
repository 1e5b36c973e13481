// Other ways to move the part than dragging it by the mouse: keys, Shift, handles, fingers, a path
// that is followed. Far from the hole, where no force is in the way.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { frame, grab, jump, open, play, program, root, scene, size, until, wait } from "./common.mjs";

export async function hands() {
    const server = await play(scene);
    const page = await open(server.url);
    await until(page, "the hand", (now) => now.isHand);
    await page.locator("#help-close").click();
    await keys(page);
    await turns(page);
    await handles(page);
    assert.deepEqual(page.complaints, []);
    await page.close();
    await fingers(server);
    await server.end();
}

const step = (now, from) => [0, 1, 2].map((i) => now.hand[i] - from.hand[i]);

/** Radians between two hands. */
function angle(now, from) {
    const dot = [3, 4, 5, 6].reduce((sum, i) => sum + now.hand[i] * from.hand[i], 0);
    return 2 * Math.acos(Math.min(1, Math.abs(dot)));
}

async function held(page, key, milliseconds = 400) {
    const from = await frame(page);
    await page.keyboard.down(key);
    await wait(milliseconds);
    await page.keyboard.up(key);
    await wait(400);
    return [from, await frame(page)];
}

async function keys(page) {
    await jump(page, "Outside");
    // Up on the screen is up in the scene, more or less.
    const [low, high] = await held(page, "ArrowUp");
    assert(step(high, low)[2] > 2e-3, `${step(high, low)}`);
    assert(high.doing === 1 && angle(high, low) < 0.05);
    const [right, left] = await held(page, "ArrowLeft");
    const across = await page.evaluate((to) => window.pegfit.along(to), step(left, right));
    assert(across[0] < 0, `${across}`);
    await page.keyboard.down("Shift");
    const [straight, turned] = await held(page, "ArrowRight");
    await page.keyboard.up("Shift");
    assert(angle(turned, straight) > 0.05, `${angle(turned, straight)}`);
    assert(size(step(turned, straight)) < 0.02);
    await page.keyboard.press("Space");
    await until(page, "letting go", (now) => now.doing === 0);
    console.log("keys move and turn the part, Space lets go");
}

async function turns(page) {
    await jump(page, "Outside");
    const from = await frame(page);
    await page.keyboard.down("Shift");
    const at = await grab(page);
    for (let i = 1; i <= 20; i += 1) {
        await page.mouse.move(at.x + 3 * i, at.y);
        await wait(25);
    }
    await wait(500);
    const turned = await frame(page);
    await page.mouse.up();
    await page.keyboard.up("Shift");
    // 60 pixels of 0.008 rad.
    assert(Math.abs(angle(turned, from) - 0.48) < 0.1, `${angle(turned, from)}`);
    console.log(`Shift and a drag turn it: ${angle(turned, from).toFixed(2)} rad`);
}

/** An arrow of the gizmo moves the part along its axis and nowhere else. */
async function handles(page) {
    await page.locator("#gizmo").check();
    await jump(page, "Outside");
    await wait(500);
    const from = await frame(page);
    const [centre, axes, height] = await page.evaluate(() => [
        window.pegfit.screen(),
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((axis) => window.pegfit.along(axis)),
        document.getElementById("view").clientHeight,
    ]);
    // Pixels per metre without foreshortening; arrows are drawn at a size of the screen.
    const scale = Math.sqrt(axes.reduce((sum, [x, y]) => sum + x * x + y * y, 0) / 2);
    const [x, y] = axes[0].map((pixels) => 0.055 * height * pixels / scale);
    await page.mouse.move(centre[0] + x, centre[1] + y);
    await page.waitForTimeout(300);
    await page.mouse.down();
    for (let i = 1; i <= 20; i += 1) {
        await page.mouse.move(centre[0] + x * (1 + i / 20), centre[1] + y * (1 + i / 20));
        await wait(25);
    }
    await wait(500);
    const after = await frame(page);
    await page.mouse.up();
    await page.locator("#gizmo").uncheck();
    const [along, ...aside] = step(after, from);
    assert(along > 2e-3 && size(aside) < 0.25 * along, `${step(after, from)}`);
    await until(page, "letting go", (now) => now.doing === 0);
    console.log(`an arrow of the handles moves it ${(1e3 * along).toFixed(1)} mm along x`);
}

/** A finger drags the part, on a screen without a mouse. */
async function fingers(server) {
    const page = await open(server.url, { width: 412, height: 880 },
        { hasTouch: true, isMobile: true });
    await until(page, "the hand", (now) => now.isHand);
    await page.locator("#help-close").tap();
    await page.getByRole("button", { name: "Outside" }).tap();
    await page.evaluate(() => window.scrollTo(0, 0));
    await page.waitForTimeout(1000);
    const touch = await page.context().newCDPSession(page);
    const send = (type, ...points) =>
        touch.send("Input.dispatchTouchEvent", { type, touchPoints: points });
    const from = await frame(page);
    const [x, y] = await page.evaluate(() => window.pegfit.screen());
    await send("touchStart", { x, y });
    for (let i = 1; i <= 20; i += 1) {
        await send("touchMove", { x, y: y - 2 * i });
        await wait(25);
    }
    await wait(500);
    const lifted = await frame(page);
    assert(step(lifted, from)[2] > 2e-3 && lifted.doing === 1, `${step(lifted, from)}`);
    await send("touchEnd");
    await until(page, "letting go", (now) => now.doing === 0);
    console.log(`a finger lifts it by ${(1e3 * step(lifted, from)[2]).toFixed(1)} mm`);
    assert.deepEqual(page.complaints, []);
    await page.close();
}

/** A button follows the path that `pegfit path` finds. */
export async function follows() {
    const folder = mkdtempSync(join(tmpdir(), "pegfit-path-"));
    const path = join(folder, "path.csv");
    execFileSync(program, ["path", scene, "-o", path, "-q"], { cwd: root });
    const server = await play(scene, "--path", path);
    const page = await open(server.url);
    await until(page, "the hand", (now) => now.isHand);
    const stage = await page.evaluate(() => window.pegfit.stage());
    // It begins outside.
    assert((await frame(page)).depth < 0);
    await page.locator("#follow").click();
    await until(page, "the fit", (now) =>
        now.doing === 5 && Math.abs(now.depth - stage.depth) < 1e-3);
    console.log("the path that was found leads in");
    assert.deepEqual(page.complaints, []);
    await page.close();
    await server.end();
    rmSync(folder, { recursive: true });
}
