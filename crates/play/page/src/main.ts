// The page: frames of the loop come in, what the person does goes out.

import "./page.css";
import { Charts } from "./charts";
import { Drag } from "./drag";
import { Events } from "./events";
import { Link } from "./link";
import { OwnParts } from "./own-parts";
import { Panel, element } from "./panel";
import { type Layer, View } from "./view";
import { type Frame, type Place, type Stage, request } from "./wire";

const view = new View(
    element<HTMLCanvasElement>("view"), element("labels"), (name) => link.bytes(name));
const charts = new Charts(element("force-chart"), element("energy-chart"), element("depth-chart"));
const events = new Events(element("events"));
const panel = new Panel(jump, () => link.send(request.take()));
const drag = new Drag(view, {
    hold: (pose) => link.send(request.hold(pose)),
    letGo: () => link.send(request.letGo()),
});

const own = new OwnParts((files, unit) => link.play(files, unit));

let newest: Frame | undefined;
let current: Stage | undefined;
let loaded = 0;
/** Another pair is being made ready, or nobody answers: what is shown is not so any more. */
let isStale = false;

const link = new Link({
    frame(frame) {
        newest = frame;
        drag.enabled = frame.isHand && frame.doing <= 1 && frame.stage === loaded;
        if (frame.stage !== loaded) return;
        stale(false);
        charts.add(frame);
        events.add(frame);
        panel.show(frame, link.arrival);
    },
    stage(stage) {
        void begin(stage);
    },
    docked: (news) => panel.docked(news),
    hello(hello) {
        pairs(hello.pairs);
        if (hello.local) own.show();
    },
    loading({ loading, pair, progress }) {
        const share = progress ? ` (${progress[0]}: ${(100 * progress[1]).toFixed(0)} %)` : "";
        stale(true);
        say(`computing the fields of ${loading}${share} …`);
        mark(pair);
    },
    checked: (report) => own.checked(report),
    trouble: say,
    open(isOpen) {
        if (!isOpen) stale(true);
        say(isOpen ? "" : "the program does not answer");
    },
});

/** Greys the old stage and its numbers until frames of the next one come. */
function stale(on: boolean): void {
    if (on === isStale) return;
    isStale = on;
    element("stage").classList.toggle("stale", on);
    panel.stale(on);
    if (!on) return;
    drag.holds = false;
    drag.enabled = false;
    view.quiet();
}

async function begin(stage: Stage): Promise<void> {
    current = stage;
    stale(true);
    drag.holds = false;
    mark(stage.pair);
    panel.start(stage);
    charts.start(stage);
    events.clear();
    await view.load(stage);
    if (current !== stage) return;
    loaded = stage.stage;
    cut();
    for (const layer of ["slice", "skeleton"] as const) show(layer);
    void accuracy(stage);
    say("");
}

function say(text: string): void {
    element("status").textContent = text;
}

function pairs(titles: string[]): void {
    element("pairs").replaceChildren(...(titles.length > 1 ? titles : []).map((title, pair) => {
        const button = document.createElement("button");
        button.textContent = title;
        button.onclick = () => link.send(request.choose(pair));
        return button;
    }));
    mark(current?.pair ?? 0);
}

function mark(pair: number): void {
    element("pairs").querySelectorAll("button").forEach((button, index) =>
        button.setAttribute("aria-pressed", String(index === pair)));
}

function jump(place: Place): void {
    drag.holds = false;
    link.send(request.place(place.pose));
}

const box = (id: string) => element<HTMLInputElement>(id);

function cut(): void {
    view.cut(box("section").checked ? Number(box("section-at").value) : undefined);
}

function show(layer: Layer): void {
    const on = box(layer).checked;
    if (on) say(`computing the ${layer === "slice" ? "density" : "skeleton"} …`);
    void view.layer(layer, on).then(() => say(""));
}

/** Saves what is there under a name. */
function save(blob: Blob | null | undefined, name: string): void {
    if (!blob) return;
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = name;
    link.click();
    // A browser that is busy fetches it later.
    setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** How far the forces are off, once somebody looks: it takes finer densities than the loop's. */
async function accuracy(stage: Stage | undefined): Promise<void> {
    const [label, value] = [element("off-by"), element("accuracy")];
    label.hidden = value.hidden = !stage || Boolean(stage.error);
    if (!stage || value.hidden || !element<HTMLDetailsElement>("about-loop").open) return;
    if (value.dataset.stage === `${stage.stage}`) return;
    value.dataset.stage = `${stage.stage}`;
    value.textContent = "computing …";
    const bytes = await link.bytes("error");
    if (current !== stage) return;
    value.textContent = bytes ? new TextDecoder().decode(bytes) : "not known";
}

async function log(): Promise<void> {
    const bytes = await link.bytes("log.csv");
    save(bytes && new Blob([bytes], { type: "text/csv" }), "pegfit-play.csv");
}

/** The handles turn the part, or move it; the button says what they could do instead. */
function handles(turn: boolean): void {
    drag.mode = turn ? "rotate" : "translate";
    element("mode").textContent = turn ? "move" : "turn";
}

function script(number: 2 | 3): void {
    drag.holds = false;
    if (newest?.doing === number) link.send(request.letGo());
    else link.send(number === 2 ? request.collision() : request.snap());
}

box("see-through").onchange = () => view.seeThrough(box("see-through").checked);
box("section").onchange = cut;
box("section-at").oninput = cut;
box("arrows").onchange = () => view.arrows(box("arrows").checked);
box("gizmo").onchange = () => {
    drag.handles(box("gizmo").checked);
    element("mode").hidden = !box("gizmo").checked;
};
element("mode").onclick = () => handles(element("mode").textContent === "turn");
for (const layer of ["slice", "skeleton"] as const) box(layer).onchange = () => show(layer);
element("about-loop").ontoggle = () => void accuracy(current);
element("home").onclick = () => view.goHome();
element("snap").onclick = () => script(3);
element("collision").onclick = () => script(2);
element("follow").onclick = () => {
    drag.holds = false;
    link.send(newest?.doing === 5 ? request.letGo() : request.follow());
};
element("let-go").onclick = () => drag.letGo();
element("dock").onclick = () => link.send(request.dock());
element("record").onclick = () => link.send(request.record(!newest?.isRecording));
element("replay").onclick = () => {
    drag.holds = false;
    link.send(request.replay());
};
element("log").onclick = () => void log();
element("picture").onclick = async () => save(await view.picture(), "pegfit-play.png");
const help = element("help");
element("help-open").onclick = () => explain(Boolean(help.hidden));
element("help-close").onclick = () => explain(false);

/** Shows the card, and both parts beside it. */
function explain(on: boolean): void {
    help.hidden = !on;
    view.shift = on && window.innerWidth > 820 ? 190 : 0;
}
explain(true);

window.addEventListener("keydown", (event) => {
    if (event.target instanceof HTMLInputElement || event.ctrlKey || event.metaKey) return;
    if (event.key === "?") explain(Boolean(help.hidden));
    else if (event.key === "Escape") explain(false);
    else if (event.key === " " && !(event.target instanceof HTMLButtonElement)) drag.letGo();
    else if (event.key === "r" || event.key === "t") handles(event.key === "r");
    else return;
    event.preventDefault();
});

// A button that was clicked gives the keys back: Space lets go of the part, and does not press it again.
document.addEventListener("click", ({ target, detail }) => {
    if (detail > 0 && target instanceof Element) target.closest("button")?.blur();
});

/** For tests in a browser: what is shown, and where on the screen the part is. */
Object.assign(window, {
    pegfit: {
        frame: () => newest,
        stage: () => (loaded === current?.stage ? current : undefined),
        messages: () => link.arrival,
        screen: () => {
            const at = view.handGrip().project(view.camera);
            const { clientWidth: width, clientHeight: height } = view.canvas;
            return [(at.x + 1) / 2 * width, (1 - at.y) / 2 * height];
        },
        /** Pixels per metre at the part along a direction of the scene. */
        along: (direction: [number, number, number]) => {
            const at = view.handGrip();
            const to = at.clone();
            to.x += direction[0] * 1e-3;
            to.y += direction[1] * 1e-3;
            to.z += direction[2] * 1e-3;
            const [a, b] = [at, to].map((p) => p.project(view.camera));
            const { clientWidth: width, clientHeight: height } = view.canvas;
            return [(b.x - a.x) / 2 * width * 1e3, (a.y - b.y) / 2 * height * 1e3];
        },
    },
});

function draw(): void {
    requestAnimationFrame(draw);
    link.pull();
    if (newest && newest.stage === loaded && !isStale) view.show(newest);
    drag.step();
    view.render();
}
draw();
