// What happened, in words, and what to do about it; the newest on top.

import type { Frame } from "./wire";
import { EVENTS, fixed } from "./words";

/** Newtons from which a touch is one, and below which it is over. */
const TOUCH = { on: 0.4, off: 0.15 };

/** The same event within so many seconds is one. */
const TOGETHER = 2;

const SHOWN = 3;

/** Flags about the hand's input, which say nothing while nobody holds it, nor in the first seconds. */
const INPUT = 4;
const SETTLES = 1;

const CONTACT = -1;

interface Event {
    /** A flag's bit, or contact. */
    what: number;
    at: number;
    count: number;
    peak?: number;
}

export class Events {
    private readonly list: Event[] = [];
    private flagged?: number[];
    private touches = false;
    private time = 0;
    private heldSince?: number;

    constructor(private readonly element: HTMLElement) {}

    clear(): void {
        this.list.length = 0;
        this.flagged = undefined;
        this.heldSince = undefined;
        this.draw();
    }

    add(frame: Frame): void {
        const before = this.flagged ?? frame.flagged;
        this.heldSince = frame.isHeld ? this.heldSince ?? frame.time : undefined;
        const settled = frame.time - (this.heldSince ?? Infinity) > SETTLES;
        for (let bit = settled ? 0 : INPUT; bit < EVENTS.length; bit += 1) {
            if (frame.flagged[bit] > before[bit]) this.note(bit, frame.time);
        }
        this.flagged = frame.flagged;
        const force = Math.hypot(...frame.force);
        if (!this.touches && force > TOUCH.on) {
            this.touches = true;
            this.note(CONTACT, frame.time, force);
        }
        if (this.touches) {
            const touch = this.list.find((event) => event.what === CONTACT);
            if (touch) touch.peak = Math.max(touch.peak ?? 0, force);
        }
        if (force < TOUCH.off) this.touches = false;
        if (frame.time - this.time > 0.25 || frame.time < this.time) {
            this.time = frame.time;
            this.draw();
        }
    }

    private note(what: number, at: number, peak?: number): void {
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
            const [row, what, when, help] =
                ["li", "b", "span", "small"].map((tag) => document.createElement(tag));
            const [words, advice] = event.what === CONTACT
                ? [`contact, up to ${fixed(event.peak ?? 0, 1)} N`, ""] : EVENTS[event.what];
            what.textContent = words;
            const times = event.count > 1 ? `${event.count} times, last at ` : "at ";
            when.textContent = `${times}${fixed(event.at, 1)} s`;
            help.textContent = advice;
            row.append(what, when, help);
            return row;
        }));
    }
}
