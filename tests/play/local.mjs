// The page without a program, of files alone: `just wasm` makes it in $PEGFIT_WASM.
import assert from "node:assert/strict";
import { spawnSync } from "node:child_process";
import { createServer } from "node:http";
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { extname, join, normalize } from "node:path";
import { frame, open, program, shot, size, until, wait } from "./common.mjs";
import { seat } from "./story.mjs";

const KINDS = {
    ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".wasm": "application/wasm",
    ".txt": "text/plain",
};

/** Files of a folder, over HTTP, and nothing else. */
async function serve(folder) {
    const asked = [];
    const server = createServer((request, reply) => {
        const name = normalize(new URL(request.url, "http://x").pathname);
        asked.push(name);
        const file = join(folder, name === "/" ? "index.html" : name);
        try {
            const bytes = readFileSync(file);
            reply.writeHead(200, { "content-type": KINDS[extname(file)] });
            reply.end(bytes);
        } catch {
            reply.writeHead(404).end();
        }
    });
    await new Promise((done) => server.listen(0, "127.0.0.1", done));
    return { url: `http://127.0.0.1:${server.address().port}/`, asked, server };
}

export async function local() {
    const { url, asked, server } = await serve(process.env.PEGFIT_WASM);
    const began = Date.now();
    const page = await open(url);
    const elsewhere = [];
    page.on("request", (request) => {
        const at = request.url();
        if (!at.startsWith(url) && !/^(data|blob):/.test(at)) elsewhere.push(at);
    });
    await until(page, "the first force", (now) => now.ticks > 0 && now.coverage > 0);
    const seconds = (Date.now() - began) / 1000;
    console.log(`first force after ${seconds.toFixed(1)} s`);
    await page.locator("#help-close").click();
    assert.match(await page.locator("#own").innerText(), /Nothing leaves this machine/);
    const stage = await page.evaluate(() => window.pegfit.stage());
    await seat(page, stage);
    await wait(1500);
    const { rate, latency } = await frame(page);
    console.log(`${rate.toFixed(0)} ticks a second, ${latency[0].toFixed(0)} µs each`);
    await keep(page);
    await choose(page);
    await meshes(page);
    assert.deepEqual(page.complaints, []);
    assert.deepEqual(elsewhere, []);
    assert(!asked.some((name) => /ws|mesh|log/.test(name)), asked.join(" "));
    await page.close();
    server.close();
}

/** A log, a picture, a density and the fits. */
async function keep(page) {
    await page.locator("#record").click();
    await page.locator("#snap").click();
    await until(page, "the recording", (now) => now.doing === 3 && now.recorded > 2);
    await page.locator("#record").click();
    const saved = async (button) => {
        const [file] = await Promise.all([
            page.waitForEvent("download"), page.locator(button).click(),
        ]);
        return readFileSync(await file.path());
    };
    const log = (await saved("#log")).toString().split("\n");
    assert(log.length > 100, `${log.length} rows`);
    assert.equal((await saved("#picture")).subarray(1, 4).toString(), "PNG");
    await page.locator("#slice").check();
    await page.waitForFunction(() => document.getElementById("status").textContent === "");
    await shot(page, "local-density");
    await page.locator("#slice").uncheck();
    await page.locator("#dock").click();
    await page.getByRole("button", { name: /^Found 1/ }).waitFor();
    const [best] = (await page.locator("#places").innerText()).match(/Found 1[^F]*/);
    console.log(best.replaceAll("\n", " "));
    const off = Number(best.match(/([\d.]+) mm and/)[1]);
    assert(off < 1, best);
    const rate = (await frame(page)).rate;
    console.log(`${rate.toFixed(0)} ticks a second after a search`);
}

/** Another of the paper's pairs. */
async function choose(page) {
    await page.getByRole("button", { name: "combined" }).click();
    await page.waitForFunction(() => window.pegfit.stage()?.title.startsWith("combined"));
    await until(page, "its loop", (now) => now.stage === 2 && now.ticks > 0);
}

/** A block with a slot and the key that fills it, in millimetres; a surface that is open; a page. */
function parts() {
    const box = ([x, y, z], [u, v, w], open = false) => {
        const corner = (i) => [i & 1 ? u : x, i & 2 ? v : y, i & 4 ? w : z].join(" ");
        const quads = [
            [0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5],
        ];
        const faces = (open ? quads.slice(0, 3) : quads)
            .flatMap(([a, b, c, d]) => [[a, b, c], [a, c, d]]);
        return [...Array(8).keys()].map((i) => `v ${corner(i)}`)
            .concat(faces.map((face) => `f ${face.map((i) => i + 1).join(" ")}`)).join("\n");
    };
    return {
        "slot.obj": prism(
            [[0, 0], [30, 0], [30, 20], [20, 20], [20, 8], [10, 8], [10, 20], [0, 20]], 20),
        "key.obj": box([10, 8, 0], [20, 20, 20]),
        "open.obj": box([0, 0, 0], [10, 10, 10], true),
        "page.stl": "<!doctype html><html><body>not found</body></html>",
    };
}

/** An outline of 8 corners with its sides and both ends, which are cut into rectangles. */
function prism(outline, height) {
    const count = outline.length;
    const vertices = [0, height].flatMap((z) => outline.map(([x, y]) => `v ${x} ${y} ${z}`));
    const faces = [];
    for (let i = 0; i < count; i += 1) {
        const j = (i + 1) % count;
        faces.push([i, j, j + count], [i, j + count, i + count]);
    }
    // Two walls and the floor between them.
    for (const [a, b, c, d] of [[0, 5, 6, 7], [1, 2, 3, 4], [0, 1, 4, 5]]) {
        const end = [[a, b, c], [a, c, d]];
        faces.push(...end.map((face) => face.map((i) => i + count)));
        faces.push(...end.map(([p, q, r]) => [r, q, p]));
    }
    return vertices.concat(faces.map((f) => `f ${f.map((i) => i + 1).join(" ")}`)).join("\n");
}

/** Drops files onto the page. */
async function drop(page, files) {
    const transfer = await page.evaluateHandle((files) => {
        const transfer = new DataTransfer();
        for (const [name, text] of files) transfer.items.add(new File([text], name));
        return transfer;
    }, files);
    await page.dispatchEvent("#view", "drop", { dataTransfer: transfer });
}

/** Bad meshes get the words of the command, good ones are played. */
async function meshes(page) {
    const all = parts();
    const folder = mkdtempSync(join(tmpdir(), "pegfit-local-"));
    for (const [name, text] of Object.entries(all)) writeFileSync(join(folder, name), text);
    const said = (...names) => {
        const check = spawnSync(program, ["check", ...names], { cwd: folder, encoding: "utf8" });
        return check.stdout.trim();
    };
    const report = async (...names) => {
        await page.evaluate(() => { document.getElementById("checked").textContent = ""; });
        await drop(page, names.map((name) => [name, all[name]]));
        await page.waitForFunction(() => document.getElementById("checked").textContent !== "");
        return page.locator("#checked").evaluate((element) => element.textContent);
    };
    const bad = ["open.obj", "page.stl"];
    assert.equal(await report(...bad), said(...bad));
    assert.match(said(...bad), /open.obj: cannot be used[^]*page.stl: cannot be used/);
    console.log("bad meshes: the command's words");
    const words = await report("key.obj", "slot.obj");
    assert(words.startsWith(said("key.obj", "slot.obj")), words);
    assert.match(words, /key in slot: they do not overlap/);
    await page.waitForFunction(() => window.pegfit.stage()?.title === "key");
    await until(page, "their loop", (now) => now.stage === 3 && now.ticks > 100);
    await page.getByRole("button", { name: /^Seated/ }).click();
    const seated = await until(page, "the seat", (now) => now.gain === 1 && Math.abs(now.depth) > 0);
    console.log(`dropped meshes: ${(1e3 * seated.energy).toFixed(1)} mJ at the seat, ` +
        `${size(seated.force).toFixed(2)} N, ${seated.rate.toFixed(0)} Hz`);
    assert(seated.energy < 0);
    await shot(page, "local-own");
    rmSync(folder, { recursive: true });
}
