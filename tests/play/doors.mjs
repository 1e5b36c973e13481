// Who is kept out: wrong tokens, pages from elsewhere, frames, garbage, floods.
import assert from "node:assert/strict";
import { once } from "node:events";
import { createServer } from "node:http";
import { browser, frame, open, play, scene, until, wait } from "./common.mjs";

export async function doors() {
    const server = await play(scene);
    const page = await open(server.url);
    await until(page, "the hand", (now) => now.isHand && now.gain === 1);
    await tokens(server.url);
    await origins(server.url);
    await garbage(page);
    await flood(page);
    const now = await until(page, "one page", (seen) => seen.pages === 1);
    assert(now.isHand, "the hand stays with its page");
    assert.deepEqual(page.complaints.filter((text) => !text.includes("WebSocket")), []);
    await page.close();
    console.log("the loop meanwhile:", ...(await server.end()));
}

async function tokens(url) {
    const page = await browser.newPage();
    const last = url.at(-2) === "0" ? "1" : "0";
    for (const wrong of [`${url.slice(0, -2)}${last}/`, new URL("/", url).href]) {
        const reply = await page.goto(wrong);
        assert.equal(reply.status(), 404, wrong);
    }
    await page.close();
    console.log("a wrong token is refused");
}

/** A page of another server, which has learned the address, gets neither socket nor picture. */
async function origins(url) {
    const other = createServer((_, reply) => {
        reply.setHeader("content-type", "text/html");
        reply.end(`<iframe src="${url}"></iframe>`);
    });
    other.listen(0, "127.0.0.1");
    await once(other, "listening");
    const page = await browser.newPage();
    await page.goto(`http://127.0.0.1:${other.address().port}/`);
    const opened = await page.evaluate((address) => new Promise((done) => {
        const socket = new WebSocket(address);
        socket.onopen = () => done(true);
        socket.onclose = () => done(false);
    }), `${url.replace("http", "ws")}ws`);
    assert.equal(opened, false);
    await wait(500);
    const framed = page.frames().map((inner) => inner.url());
    assert(!framed.includes(url), `${framed}`);
    await page.close();
    other.close();
    console.log("a page from elsewhere gets no socket and shows no frame");
}

/** The reason why a socket was closed that sent something. */
const sent = (page, what) => page.evaluate((bytes) => new Promise((done) => {
    const socket = new WebSocket(new URL("ws", location.href.replace("http", "ws")));
    socket.onopen = () =>
        socket.send(typeof bytes === "string" ? bytes : new Uint8Array(bytes));
    socket.onclose = ({ code }) => done(code);
}), what);

async function garbage(page) {
    for (const [what, code] of [
        ["let me in", 1003], [[], 1003], [[77], 1003], [[1, 2, 3], 1003], [[3, 9], 1003],
        [[1, ...Array(28).fill(255)], 1003], [Array(65).fill(0), 1009],
    ]) {
        assert.equal(await sent(page, what), code, `${what}`);
    }
    console.log("garbage is shown the door");
}

/** Seconds of the flood, and of the quiet before it. */
const LONG = 3;

/** Ticks that were missed in so many seconds, and ticks there were. */
async function missed(page, seconds) {
    const before = await frame(page);
    await wait(1000 * seconds);
    const after = await frame(page);
    return [after.missed - before.missed, after.ticks - before.ticks];
}

/** Ten thousand messages a second from a page of its own, which comes back when it is put out. */
async function flood(page) {
    const [before, ticks] = await missed(page, LONG);
    const worker = page.evaluate((seconds) => new Promise((done) => {
        const address = new URL("ws", location.href.replace("http", "ws"));
        const began = performance.now();
        let [socket, count, doors] = [undefined, 0, 0];
        const isOver = () => performance.now() > began + 1e3 * seconds;
        const enter = () => {
            socket = new WebSocket(address);
            socket.onclose = () => {
                doors += 1;
                if (isOver()) done([count, doors]);
                else enter();
            };
        };
        enter();
        const beat = new Uint8Array([0]);
        const timer = setInterval(() => {
            if (isOver()) {
                clearInterval(timer);
                // What was sent is still being refused.
                setTimeout(() => {
                    socket.onclose = () => done([count, doors]);
                    socket.close();
                }, 3000);
            }
            if (socket.readyState !== WebSocket.OPEN) return;
            const due = 10 * (performance.now() - began);
            for (; count < due; count += 1) socket.send(beat);
        }, 4);
    }), LONG);
    const [during, flooded] = await missed(page, LONG);
    const [count, doors] = await worker;
    console.log(`${(count / LONG).toFixed(0)} messages a second, put out ${doors} times: ` +
        `${during} of ${flooded + during} ticks missed, ${before} of ${ticks + before} before`);
    assert(doors > 0 && count > 3000, `${count} messages, ${doors} times out`);
    // What two stretches of three seconds differ by on a machine that does much else.
    assert(during <= 3 * before + 0.05 * flooded, `${during} ticks missed`);
}
