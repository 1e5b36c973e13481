// Frames on their way to the page, and whether its hand is still there: what every worker has.

/** The hand is heard of this often, milliseconds; the loop lets go after 100 ms of silence. */
export const BEAT = 30;

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
    | { send: ArrayBuffer }
    /** The bytes called `name`, as the answer to this question. */
    | { want: string; question: number }
    /** Mesh files to play with, their coordinates in a unit. */
    | { files: MeshFile[]; unit: string };

export interface MeshFile {
    name: string;
    bytes: ArrayBuffer;
}

/** From the worker to the page. */
export type FromWorker =
    | { open: boolean }
    | { text: string }
    | { frames: ArrayBuffer[]; rate: number; age: number; oldest: number }
    | { question: number; bytes?: ArrayBuffer };

export const post = (message: FromWorker) => self.postMessage(message);

export class Outbox {
    private waiting: ArrayBuffer[] = [];
    private asked = performance.now();
    /** When frames came in the last second, and how old each was. */
    private seen: [number, number][] = [];
    isHand = false;
    looked = true;

    add(frame: ArrayBuffer): void {
        const view = new DataView(frame);
        this.isHand = view.getUint8(1) === 1;
        const now = performance.now();
        this.seen.push([now, performance.timeOrigin + now - view.getFloat64(16, true)]);
        while (this.seen[0][0] < now - 1000) this.seen.shift();
        this.waiting.push(frame);
        if (this.waiting.length > WAITING) this.waiting.shift();
    }

    /** Gives the page what waits. */
    send(): void {
        this.asked = performance.now();
        const ages = this.seen.map(([, age]) => age).sort((a, b) => a - b);
        const [age, oldest] = [ages[ages.length >> 1] ?? 0, ages.at(-1) ?? 0];
        post({ frames: this.waiting, rate: ages.length, age, oldest });
        this.waiting = [];
    }

    /** Whether the page's hand is there. */
    get isAlive(): boolean {
        return this.isHand && this.looked && performance.now() - this.asked < LIFE;
    }
}
