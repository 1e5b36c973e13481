// The connection to the loop: frames and news in, requests out, again and again if it breaks.

import { type Docked, type Frame, type Stage, readFrame, request } from "./wire";

/** The hand is heard of this often, milliseconds; the loop lets go after 100 ms of silence. */
const BEAT = 30;

export interface Listener {
    frame(frame: Frame): void;
    stage(stage: Stage): void;
    docked(docked: Docked): void;
    hello(pairs: string[]): void;
    loading(title: string, pair: number): void;
    /** Whether there is a connection. */
    open(isOpen: boolean): void;
}

export class Link {
    private socket?: WebSocket;
    private sent = 0;
    isHand = false;

    constructor(private readonly listener: Listener) {
        this.connect();
        window.setInterval(() => this.beat(), BEAT);
    }

    send(message: ArrayBuffer): void {
        if (this.socket?.readyState !== WebSocket.OPEN) return;
        this.socket.send(message);
        this.sent = performance.now();
    }

    private beat(): void {
        if (this.isHand && performance.now() - this.sent > BEAT / 2) this.send(request.beat());
    }

    private connect(): void {
        const address = new URL("ws", location.href);
        address.protocol = "ws:";
        const socket = new WebSocket(address);
        socket.binaryType = "arraybuffer";
        socket.onopen = () => {
            this.listener.open(true);
            this.send(request.take());
        };
        socket.onmessage = (event) => this.hear(event.data);
        socket.onclose = () => {
            this.isHand = false;
            this.listener.open(false);
            window.setTimeout(() => this.connect(), 1000);
        };
        this.socket = socket;
    }

    private hear(data: ArrayBuffer | string): void {
        if (typeof data !== "string") {
            const frame = readFrame(data);
            if (!frame) return;
            this.isHand = frame.isHand;
            this.listener.frame(frame);
            return;
        }
        const news = JSON.parse(data);
        if ("pairs" in news) this.listener.hello(news.pairs);
        else if ("loading" in news) this.listener.loading(news.loading, news.pair);
        else if ("stage" in news) this.listener.stage(news);
        else this.listener.docked(news);
    }
}
