// The socket, away from the drawing: a page that draws slowly is still heard in time, and frames do
// not queue up behind its pictures. They wait here until the page asks for them.

import { request } from "./wire";

/** The hand is heard of this often, milliseconds; the loop lets go after 100 ms of silence. */
const BEAT = 30;

/** A page that has not asked for frames for so long hangs: its hand lets go. */
const LIFE = 2500;

/** Frames that wait at most: two seconds of them. */
const WAITING = 120;

/** From the page to the worker. */
export type ToWorker =
    | { connect: string }
    /** It is there, and wants the frames that wait. */
    | { frames: true }
    /** Whether it is looked at: another tab's page lets go. */
    | { looked: boolean }
    | { send: ArrayBuffer };

/** From the worker to the page. */
export type FromWorker =
    | { open: boolean }
    | { text: string }
    | { frames: ArrayBuffer[]; rate: number; age: number; oldest: number };

const post = (message: FromWorker) => self.postMessage(message);

let socket: WebSocket | undefined;
let waiting: ArrayBuffer[] = [];
let isHand = false;
let looked = true;
let sent = 0;
let asked = performance.now();
/** When frames came in the last second, and how old each was. */
let seen: [number, number][] = [];

function send(message: ArrayBuffer): void {
    if (socket?.readyState !== WebSocket.OPEN) return;
    socket.send(message);
    sent = performance.now();
}

function hear(frame: ArrayBuffer): void {
    const view = new DataView(frame);
    isHand = view.getUint8(1) === 1;
    const now = performance.now();
    seen.push([now, performance.timeOrigin + now - view.getFloat64(16, true)]);
    while (seen[0][0] < now - 1000) seen.shift();
    waiting.push(frame);
    if (waiting.length > WAITING) waiting.shift();
}

function connect(address: string): void {
    socket = new WebSocket(address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
        post({ open: true });
        send(request.take());
    };
    socket.onmessage = ({ data }) => {
        if (typeof data === "string") post({ text: data });
        else hear(data);
    };
    socket.onclose = () => {
        isHand = false;
        post({ open: false });
        setTimeout(() => connect(address), 1000);
    };
}

function frames(): void {
    asked = performance.now();
    const ages = seen.map(([, age]) => age).sort((a, b) => a - b);
    const [age, oldest] = [ages[ages.length >> 1] ?? 0, ages.at(-1) ?? 0];
    post({ frames: waiting, rate: ages.length, age, oldest });
    waiting = [];
}

self.onmessage = ({ data }: MessageEvent<ToWorker>) => {
    if ("connect" in data) connect(data.connect);
    else if ("send" in data) send(data.send);
    else if ("looked" in data) looked = data.looked;
    else frames();
};

setInterval(() => {
    const now = performance.now();
    if (isHand && looked && now - asked < LIFE && now - sent > BEAT / 2) send(request.beat());
}, BEAT);
