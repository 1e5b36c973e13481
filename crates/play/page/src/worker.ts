// The socket, away from the drawing: a page that draws slowly is still heard in time, and frames do
// not queue up behind its pictures. They wait here until the page asks for them.

import { BEAT, Outbox, type ToWorker, post } from "./outbox";
import { request } from "./wire";

const outbox = new Outbox();
let socket: WebSocket | undefined;
let sent = 0;

function send(message: ArrayBuffer): void {
    if (socket?.readyState !== WebSocket.OPEN) return;
    socket.send(message);
    sent = performance.now();
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
        else outbox.add(data);
    };
    socket.onclose = () => {
        outbox.isHand = false;
        post({ open: false });
        setTimeout(() => connect(address), 1000);
    };
}

async function answer(name: string, question: number): Promise<void> {
    const reply = await fetch(name).catch(() => undefined);
    post({ question, bytes: reply?.ok ? await reply.arrayBuffer() : undefined });
}

self.onmessage = ({ data }: MessageEvent<ToWorker>) => {
    if ("connect" in data) connect(data.connect);
    else if ("send" in data) send(data.send);
    else if ("looked" in data) outbox.looked = data.looked;
    else if ("want" in data) void answer(data.want, data.question);
    else if ("frames" in data) outbox.send();
};

setInterval(() => {
    if (outbox.isAlive && performance.now() - sent > BEAT / 2) send(request.beat());
}, BEAT);
