// The connection to the loop: frames and news in, requests out.

import { type Docked, type Frame, type Stage, readFrame } from "./wire";
import type { FromWorker, ToWorker } from "./worker";

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
    private readonly worker = new Worker("worker.js", { type: "module" });
    private asks = false;
    /** Frames a second, their age in the middle and at most, milliseconds, as they come in. */
    arrival: [number, number, number] = [0, 0, 0];

    constructor(private readonly listener: Listener) {
        this.worker.onmessage = ({ data }: MessageEvent<FromWorker>) => this.hear(data);
        const address = new URL("ws", location.href);
        address.protocol = "ws:";
        this.tell({ connect: address.href });
        document.addEventListener("visibilitychange", () =>
            this.tell({ looked: document.visibilityState === "visible" }));
    }

    send(message: ArrayBuffer): void {
        this.tell({ send: message });
    }

    /** Asks for the frames that wait; once per picture, and not before the last ones came. */
    pull(): void {
        if (this.asks) return;
        this.asks = true;
        this.tell({ frames: true });
    }

    private tell(message: ToWorker): void {
        this.worker.postMessage(message);
    }

    private hear(message: FromWorker): void {
        if ("frames" in message) {
            this.asks = false;
            this.arrival = [message.rate, message.age, message.oldest];
            for (const buffer of message.frames) {
                const frame = readFrame(buffer);
                if (frame) this.listener.frame(frame);
            }
        } else if ("open" in message) this.listener.open(message.open);
        else this.news(JSON.parse(message.text));
    }

    private news(news: Record<string, unknown>): void {
        if ("pairs" in news) this.listener.hello(news.pairs as string[]);
        else if ("loading" in news) {
            this.listener.loading(news.loading as string, news.pair as number);
        } else if ("stage" in news) this.listener.stage(news as unknown as Stage);
        else this.listener.docked(news as Docked);
    }
}
