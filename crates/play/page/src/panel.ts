// Numbers, places and buttons beside the picture.

import type { Docked, Frame, Place, Stage } from "./wire";
import { HOLDS, fixed } from "./words";

export function element<T extends HTMLElement = HTMLElement>(id: string): T {
    const found = document.getElementById(id);
    if (!found) throw new Error(`no element ${id}`);
    return found as T;
}

export class Panel {
    private limits: [number, number] = [5, 0.3];
    private places: Place[] = [];
    private shown = 0;

    constructor(private readonly jump: (place: Place) => void, private readonly take: () => void) {}

    start(stage: Stage): void {
        this.limits = stage.limits ?? this.limits;
        this.places = stage.places ?? [];
        element("follow").hidden = !stage.path;
        this.docked({ docked: [] });
        const words = [stage.source, stage.error, stage.coarser].filter(Boolean);
        element("error").textContent = words.join(" ");
    }

    /** Numbers and charts are of a pair that is no longer there, or of a loop that does not answer. */
    stale(on: boolean): void {
        for (const part of ["felt", "force-chart", "energy-chart", "depth-chart", "rates", "rate", "events"]) {
            element(part).classList.toggle("stale", on);
        }
        if (!on) return;
        this.shown = 0;
        this.list([], []);
        for (const button of document.querySelectorAll<HTMLButtonElement>("#panel .act")) {
            button.disabled = true;
        }
        element("role").replaceChildren();
        element("role").dataset.key = "";
    }

    docked(news: Docked): void {
        const button = element<HTMLButtonElement>("dock");
        button.dataset.busy = news.docking ? "1" : "";
        button.textContent = news.docking ? "Looking …" : "Find where it fits";
        if (news.failed) button.title = news.failed;
        if (news.docked) this.list(this.places, news.docked);
    }

    private list(places: Place[], found: Place[]): void {
        const rows = [...places, ...found].map((place) => {
            const [row, button] = [document.createElement("li"), document.createElement("button")];
            const note = document.createElement("small");
            row.classList.toggle("found", found.includes(place));
            button.textContent = place.title;
            note.textContent = place.note;
            button.append(note);
            button.onclick = () => this.jump(place);
            row.append(button);
            return row;
        });
        element("places").replaceChildren(...rows);
    }

    /** All that follows a frame, ten times a second. */
    show(frame: Frame, arrival: [number, number, number]): void {
        const now = performance.now();
        if (now - this.shown < 100) return;
        this.shown = now;
        const [force, torque] = [Math.hypot(...frame.force), Math.hypot(...frame.torque)];
        const set = (id: string, text: string) => {
            element(id).textContent = text;
        };
        set("force", fixed(force, 2));
        set("torque", fixed(1e3 * torque, 0));
        set("energy", fixed(1e3 * frame.energy, 1));
        set("depth", fixed(1e3 * frame.depth, 1));
        element<HTMLProgressElement>("force-bar").value = force / this.limits[0];
        element<HTMLProgressElement>("torque-bar").value = torque / this.limits[1];
        const micros = ([mean, worst]: [number, number]) =>
            `${mean.toFixed(0)} µs, worst ${worst.toFixed(0)} µs`;
        set("rate", `${frame.rate.toFixed(0)} Hz, ${frame.missed} of ${frame.ticks} missed`);
        set("latency", micros(frame.latency));
        set("lateness", micros(frame.lateness));
        const [rate, age] = arrival;
        set("page-rate", `${rate} a second, ${Math.max(0, age).toFixed(1)} ms old`);
        this.buttons(frame);
        this.role(frame);
    }

    private buttons(frame: Frame): void {
        const hand = frame.isHand;
        const tape = frame.recorded > 0;
        const press = (id: string, on: boolean, usable = hand) => {
            const button = element<HTMLButtonElement>(id);
            button.classList.toggle("on", on);
            button.disabled = !usable;
        };
        press("snap", frame.doing === 3);
        press("collision", frame.doing === 2);
        press("follow", frame.doing === 5);
        press("let-go", false);
        press("record", frame.isRecording);
        press("replay", frame.doing === 4, hand && tape);
        press("dock", false, hand && !element("dock").dataset.busy);
        const seconds = frame.recorded.toFixed(0);
        element("record").textContent = frame.isRecording ? `Stop, ${seconds} s` : "Record";
        element<HTMLButtonElement>("log").disabled = !tape;
        for (const button of document.querySelectorAll<HTMLButtonElement>("#pairs button, #places button")) {
            button.disabled = !hand;
        }
    }

    private role(frame: Frame): void {
        const others = frame.pages - (frame.isHand ? 1 : 0);
        const watching = others === 1 ? "1 page watches" : `${others} pages watch`;
        const words = frame.isHand
            ? `${HOLDS[frame.doing]}${others > 0 ? `; ${watching}` : ""}`
            : frame.isHeld ? "You watch; another page has the hand"
                : "You watch; nobody holds the part";
        const role = element("role");
        const key = `${words}${frame.isHeld}${frame.isHand}`;
        if (role.dataset.key === key) return;
        role.dataset.key = key;
        const [text, dot] = [document.createElement("span"), document.createElement("i")];
        dot.className = !frame.isHand ? "dot" : frame.doing === 0 ? "dot free" : "dot on";
        text.append(dot, words);
        role.replaceChildren(text);
        if (!frame.isHeld) {
            const button = document.createElement("button");
            button.textContent = "Take it";
            button.onclick = this.take;
            role.append(button);
        }
    }
}
