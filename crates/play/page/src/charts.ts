// Force against time, energy against time and against depth.

import uPlot from "uplot";
import { type Colour, css, onScheme } from "./colours";
import type { Frame, Stage } from "./wire";
import { tick } from "./words";

/** Seconds that are seen, and pixels of height. */
const SPAN = 10;
const HEIGHT = 108;

/** Points that are kept: a minute, for the figure of a script to grow. */
const KEPT = 3600;

/** Milliseconds between two drawings. */
const REDRAW = 66;

function axis(size: number, colour: Colour = "soft"): uPlot.Axis {
    return {
        stroke: () => css(colour), font: "12px system-ui, sans-serif", size, gap: 4,
        grid: { stroke: () => css("line"), width: 1 }, ticks: { show: false },
        values: (_, ticks) => ticks.map(tick),
    };
}

/** A title; words may have the colour of their curve. */
function title(parent: HTMLElement, words: [text: string, colour?: Colour][]): void {
    const line = document.createElement("h3");
    line.append(...words.map(([text, colour]) => {
        const word = document.createElement("span");
        word.className = colour ?? "";
        word.textContent = text;
        return word;
    }));
    parent.append(line);
}

function make(parent: HTMLElement, series: uPlot.Series[], scales: uPlot.Scales,
    axes: uPlot.Axis[]): uPlot {
    const size = () => ({ width: Math.max(40, parent.clientWidth), height: HEIGHT });
    const chart = new uPlot({
        ...size(), padding: [10, axes.length > 1 ? 0 : 14, 0, 0],
        legend: { show: false }, cursor: { show: false }, scales,
        axes: [{ ...axis(20), space: 60 }, ...axes.map((one) => ({ space: 26, ...one }))],
        series: [{}, ...series],
    }, [[], ...series.map(() => [])], parent);
    new ResizeObserver(() => chart.setSize(size())).observe(parent);
    onScheme(() => chart.redraw());
    return chart;
}

const line = (colour: Colour, width = 1.75): uPlot.Series =>
    ({ stroke: () => css(colour), width, points: { show: false } });

/** At least from 0 to `least`, with some room. */
const above = (least: number): uPlot.Scale.Range =>
    (_, min, max) => [Math.min(0, min ?? 0), Math.max(least, 1.1 * (max ?? 0))];

/** What there is, at least 1 mJ of it. */
const energies: uPlot.Scale.Range = (_, min, max) => {
    const [low, high] = [min ?? 0, max ?? 0];
    const more = Math.max(0.05 * (high - low), (1 - (high - low)) / 2);
    return [low - more, high + more];
};

export class Charts {
    private readonly time: number[] = [];
    private readonly force: number[] = [];
    private readonly torque: number[] = [];
    private readonly energy: number[] = [];
    private readonly depth: number[] = [];
    private readonly charts: [uPlot, uPlot, uPlot];
    private profile: [number, number][] = [];
    private since = 0;
    private doing = 0;
    private drawn = 0;

    constructor(force: HTMLElement, energy: HTMLElement, depth: HTMLElement) {
        const x: uPlot.Scale = { time: false, range: () => this.seconds() };
        title(force, [["force (N)", "force"], [" and "], ["torque (mN·m)", "torque"], [", time (s)"]]);
        title(energy, [["energy (mJ)", "energy"], [", time (s)"]]);
        title(depth, [["energy (mJ)", "energy"], [", depth (mm)"]]);
        const dots: uPlot.Series = {
            ...line("energy"), paths: () => null,
            points: { show: true, size: 5, fill: () => css("energy"), stroke: () => css("energy") },
        };
        this.charts = [
            make(force, [line("force"), { ...line("torque", 1.25), scale: "torque" }],
                { x, y: { range: above(1) }, torque: { range: above(10) } },
                [axis(40, "force"), {
                    ...axis(38, "torque"), scale: "torque", side: 1, grid: { show: false },
                }]),
            make(energy, [line("energy")], { x, y: { range: energies } }, [axis(40)]),
            make(depth, [line("curve"), dots], {
                x: { time: false, range: (_, min, max) => [min ?? 0, max ?? 1] },
                y: { range: energies },
            }, [axis(40)]),
        ];
    }

    /** Begins anew. */
    start(stage: Stage): void {
        for (const list of [this.time, this.force, this.torque, this.energy, this.depth]) {
            list.length = 0;
        }
        this.profile = (stage.profile ?? []).map(([depth, energy]) => [1e3 * depth, 1e3 * energy]);
        this.doing = 0;
    }

    private seconds(): [number, number] {
        const now = this.time.at(-1) ?? 0;
        if (this.doing >= 2) return [this.since, Math.max(this.since + SPAN, now)];
        return [Math.max(0, now - SPAN), Math.max(SPAN, now)];
    }

    add(frame: Frame): void {
        if (frame.doing !== this.doing) {
            [this.doing, this.since] = [frame.doing, frame.time];
        }
        if (frame.time <= (this.time.at(-1) ?? -1)) return;
        this.time.push(frame.time);
        this.force.push(Math.hypot(...frame.force));
        this.torque.push(1e3 * Math.hypot(...frame.torque));
        this.energy.push(1e3 * frame.energy);
        this.depth.push(1e3 * frame.depth);
        if (this.time.length > 1.2 * KEPT) {
            const lists = [this.time, this.force, this.torque, this.energy, this.depth];
            for (const list of lists) list.splice(0, list.length - KEPT);
        }
        if (performance.now() - this.drawn > REDRAW) this.draw();
    }

    private draw(): void {
        this.drawn = performance.now();
        const from = this.time.findIndex((t) => t >= this.seconds()[0]);
        const seen = (list: number[]) => list.slice(Math.max(0, from));
        const [time, energy] = [seen(this.time), seen(this.energy)];
        this.charts[0].setData([time, seen(this.force), seen(this.torque)]);
        this.charts[1].setData([time, energy]);
        this.charts[2].setData(this.against(seen(this.depth).slice(-90), energy.slice(-90)));
    }

    /** The curve straight in, and where the part has just been, in order of depth. */
    private against(depth: number[], energy: number[]): uPlot.AlignedData {
        const [low, high] = [this.profile[0]?.[0] ?? -Infinity, this.profile.at(-1)?.[0] ?? Infinity];
        const rows: [number, number | null, number | null][] = [
            ...this.profile.map(([d, e]): [number, number, null] => [d, e, null]),
            ...depth.map((d, i): [number, null, number] =>
                [Math.min(high, Math.max(low, d)), null, energy[i]]),
        ].sort((a, b) => a[0] - b[0]) as [number, number | null, number | null][];
        // A gap in one curve where the other has a point is none.
        const straight = rows.map((row) => row[1] === null ? undefined : row[1]);
        return [rows.map((r) => r[0]), straight, rows.map((r) => r[2])] as uPlot.AlignedData;
    }
}
