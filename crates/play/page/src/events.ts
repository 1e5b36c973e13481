// What happened, in words: contact, limits, passivity, faults; the newest on top.

import { FLAG_NAMES, type Frame } from "./wire";

/** Newtons from which a touch is one, and below which it is over. */
const TOUCH = { on: 0.4, off: 0.15 };

/** The same event within so many seconds is one. */
const TOGETHER = 2;

const SHOWN = 3;

interface Event {
    what: string;
    at: number;
    count: number;
    peak?: number;
}

export class Events {
    private readonly list: Event[] = [];
    private flagged?: number[];
    private touches = false;
    private time = 0;

    constructor(private readonly element: HTMLElement) {}

    clear(): void {
        this.list.length = 0;
        this.flagged = undefined;
        this.draw();
    }

    add(frame: Frame): void {
        const before = this.flagged ?? frame.flagged;
        // Nobody holds the hand: silence is no event.
        const first = frame.isHeld ? 0 : 4;
        for (let bit = first; bit < FLAG_NAMES.length; bit += 1) {
            if (frame.flagged[bit] > before[bit]) this.note(FLAG_NAMES[bit], frame.time);
        }
        this.flagged = frame.flagged;
        const force = Math.hypot(...frame.force);
        if (!this.touches && force > TOUCH.on) {
            this.touches = true;
            this.note("contact", frame.time, force);
        }
        if (this.touches) {
            const touch = this.list.find((event) => event.what === "contact");
            if (touch) touch.peak = Math.max(touch.peak ?? 0, force);
        }
        if (force < TOUCH.off) this.touches = false;
        if (frame.time - this.time > 0.25 || frame.time < this.time) {
            this.time = frame.time;
            this.draw();
        }
    }

    private note(what: string, at: number, peak?: number): void {
        const same = this.list.find((event) => event.what === what && at - event.at < TOGETHER);
        if (same) {
            same.at = at;
            same.count += 1;
            return;
        }
        this.list.unshift({ what, at, count: 1, peak });
        this.list.length = Math.min(this.list.length, SHOWN);
    }

    private draw(): void {
        this.element.replaceChildren(...this.list.map((event) => {
            const [row, what, when] = ["li", "b", "span"].map((tag) => document.createElement(tag));
            const peak = event.peak === undefined ? "" : `, up to ${event.peak.toFixed(1)} N`;
            what.textContent = event.what + peak;
            const times = event.count > 1 ? `${event.count}×, ` : "";
            when.textContent = `${times}${event.at.toFixed(1)} s`;
            row.append(what, when);
            return row;
        }));
    }
}
