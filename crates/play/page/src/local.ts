// In place of the socket where there is no program: the loop itself, compiled to WebAssembly. A
// second worker of the same kind looks for fits and computes densities: the loop goes on meanwhile.

import init, { Meshes, Play, pairs } from "./pegfit.js";
import { BEAT, type MeshFile, Outbox, type ToWorker, post } from "./outbox";
import { request } from "./wire";

/** Milliseconds between two frames. */
const FRAME = 16;

/** Milliseconds between two looks at a loop that nobody sees, and between two words on progress. */
const REST = 100;

/** The pair to begin with: the square peg, whose fields take least time. */
const FIRST = 1;

/** What is played: a pair of the paper's by its number, or files. */
type Choice = number | { files: MeshFile[]; unit: string };

/** To the second worker. */
type Task =
    | { open: Choice }
    | { want: string; question: number }
    | { dock: true };

const program = { module_or_path: new URL("pegfit_bg.wasm", import.meta.url) };

const outbox = new Outbox();
const titles: string[] = [];
/** Two files that can be used, once there are. */
let own: Choice | undefined;
let choice: Choice = FIRST;
let number = 0;
let play: Play | undefined;
let helper: Worker | undefined;

const news = (message: object) => post({ text: JSON.stringify(message) });
const words = (error: unknown) => (error instanceof Error ? error.message : String(error));

function read({ files, unit }: { files: MeshFile[]; unit: string }): Meshes {
    const meshes = new Meshes(unit);
    for (const { name, bytes } of files) meshes.add(name, new Uint8Array(bytes));
    return meshes;
}

function open(choice: Choice): Play {
    if (typeof choice === "number") return Play.paper(choice, number);
    const meshes = read(choice);
    try {
        return Play.own(meshes, number);
    } finally {
        meshes.free();
    }
}

/** Tells the page what is being computed, seldom enough. */
function progress(): void {
    const pair = typeof choice === "number" ? choice : titles.length - 1;
    const loading = { loading: titles[pair], pair };
    let told = performance.now();
    news(loading);
    Object.assign(globalThis, {
        pegfitProgress: (stage: string, share: number) => {
            if (performance.now() - told < REST) return;
            told = performance.now();
            news({ ...loading, progress: [stage, share] });
        },
    });
}

function begin(next: Choice): void {
    choice = next;
    number += 1;
    helper?.terminate();
    helper = undefined;
    play?.free();
    play = undefined;
    progress();
    try {
        play = open(choice);
    } catch (error) {
        news({ trouble: words(error) });
        return;
    }
    post({ text: play.description() });
    news({ docked: [] });
    turn();
}

/** The second worker, with the pair that is played. */
function help(task: Task): void {
    if (!helper) {
        const address = new URL("worker.js", import.meta.url);
        helper = new Worker(address, { type: "module", name: "helper" });
        helper.onmessage = ({ data }) => self.postMessage(data);
        helper.postMessage({ open: choice } satisfies Task);
    }
    helper.postMessage(task);
}

function files(files: MeshFile[], unit: string): void {
    const meshes = read({ files, unit });
    news({ checked: meshes.report() });
    const usable = meshes.isPair();
    meshes.free();
    if (!usable) return;
    own = { files, unit };
    greet();
    begin(own);
}

function greet(): void {
    titles.splice(0, titles.length, ...JSON.parse(pairs()), ...(own ? ["your parts"] : []));
    news({ pairs: titles, local: true });
}

/** The loop: until the next tick is due it waits awake, as there is no sleep as short as that. */
const { port1, port2 } = new MessageChannel();
let turning = false;
let framed = 0;

function turn(): void {
    if (turning || !play) return;
    turning = true;
    if (outbox.looked) port2.postMessage(0);
    else setTimeout(() => port2.postMessage(0), REST);
}

port1.onmessage = () => {
    turning = false;
    if (!play) return;
    try {
        while (!play.step());
        if (performance.now() - framed >= FRAME) {
            framed = performance.now();
            const frame = play.frame();
            if (frame) outbox.add(frame.slice().buffer as ArrayBuffer);
        }
    } catch (error) {
        play = undefined;
        news({ trouble: `the loop stopped: ${words(error)}` });
    }
    turn();
};

function handle(message: ArrayBuffer): void {
    const bytes = new Uint8Array(message);
    const [kind, pair] = bytes;
    if (kind === 6 && bytes.length === 2) {
        const next = pair < titles.length - (own ? 1 : 0) ? pair : own;
        if (next !== undefined && next !== choice) begin(next);
    } else if (kind === 9 && play) {
        news({ docking: true });
        help({ dock: true });
    } else play?.handle(bytes);
}

function answer(name: string, question: number): void {
    if (/^(slice\/|skeleton\/|error$)/.test(name)) return help({ want: name, question });
    post({ question, bytes: bytes(name) });
}

async function connect(): Promise<void> {
    try {
        await init(program);
    } catch (error) {
        news({ trouble: `this browser cannot run the page: ${words(error)}` });
        return;
    }
    post({ open: true });
    greet();
    begin(FIRST);
}

function loop({ data }: MessageEvent<ToWorker>): void {
    if ("connect" in data) void connect();
    else if ("send" in data) handle(data.send);
    else if ("looked" in data) outbox.looked = data.looked;
    else if ("want" in data) answer(data.want, data.question);
    else if ("files" in data) files(data.files, data.unit);
    else outbox.send();
}

/** The bytes called `name` of the pair that is open. */
function bytes(name: string): ArrayBuffer | undefined {
    return play?.bytes(name)?.slice().buffer as ArrayBuffer | undefined;
}

/** What the second worker does, one task after the other. */
async function assist(task: Task): Promise<void> {
    if ("open" in task) {
        await init(program);
        Object.assign(globalThis, { pegfitProgress: () => {} });
        play = open(task.open);
    } else if (!play) throw new Error("the parts could not be opened a second time");
    else if ("dock" in task) post({ text: play.dock() });
    else post({ question: task.question, bytes: bytes(task.want) });
}

/** Whoever waits for a task that failed waits no longer. */
function excuse(task: Task, error: unknown): void {
    if ("want" in task) post({ question: task.question });
    else if ("dock" in task) news({ docked: [], failed: words(error) });
}

if (self.name === "helper") {
    let last = Promise.resolve();
    self.onmessage = ({ data }: MessageEvent<Task>) => {
        last = last.then(() => assist(data)).catch((error) => excuse(data, error));
    };
} else {
    self.onmessage = (event) => {
        try {
            loop(event);
        } catch (error) {
            news({ trouble: words(error) });
        }
    };
    setInterval(() => {
        if (outbox.isAlive) play?.handle(new Uint8Array(request.beat()));
    }, BEAT);
}
