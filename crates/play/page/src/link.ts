// The connection to the loop: frames and news in, requests out.

import type { FromWorker, MeshFile, ToWorker } from "./outbox";
import { type Docked, type Frame, type Hello, type Loading, type Stage, readFrame } from "./wire";

export interface Listener {
    frame(frame: Frame): void;
    stage(stage: Stage): void;
    docked(docked: Docked): void;
    hello(hello: Hello): void;
    loading(loading: Loading): void;
    /** What `pegfit check` says of the page's own meshes. */
    checked(report: string): void;
    /** Why there is nothing to play with. */
    trouble(why: string): void;
    /** Whether there is a connection. */
    open(isOpen: boolean): void;
}

export class Link {
    private readonly worker = new Worker("worker.js", { type: "module" });
    private asks = false;
    private readonly questions = new Map<number, (bytes: ArrayBuffer | undefined) => void>();
    private asked = 0;
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

    /** The bytes called `name`, if there is such a thing. */
    readonly bytes = (name: string): Promise<ArrayBuffer | undefined> => {
        this.asked += 1;
        const question = this.asked;
        this.tell({ want: name, question });
        return new Promise((answer) => this.questions.set(question, answer));
    };

    /** Meshes of the page's own, their coordinates in `unit`. */
    play(files: MeshFile[], unit: string): void {
        this.tell({ files, unit });
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
        } else if ("question" in message) {
            this.questions.get(message.question)?.(message.bytes);
            this.questions.delete(message.question);
        } else if ("open" in message) this.listener.open(message.open);
        else this.news(JSON.parse(message.text));
    }

    private news(news: Record<string, unknown>): void {
        if ("pairs" in news) this.listener.hello(news as unknown as Hello);
        else if ("loading" in news) this.listener.loading(news as unknown as Loading);
        else if ("stage" in news) this.listener.stage(news as unknown as Stage);
        else if ("checked" in news) this.listener.checked(news.checked as string);
        else if ("trouble" in news) this.listener.trouble(news.trouble as string);
        else this.listener.docked(news as Docked);
    }
}
