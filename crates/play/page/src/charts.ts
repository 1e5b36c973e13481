// Force against time, energy against time and against depth.

import uPlot from "uplot";
import { CSS } from "./colours";
import type { Frame, Stage } from "./wire";

/** Seconds that are seen, and pixels of height. */
const SPAN = 10;
const HEIGHT = 72;

/** Points that are kept: a minute, for the figure of a script to grow. */
const KEPT = 3600;

/** Milliseconds between two drawings. */
const REDRAW = 66;

function axis(size: number): uPlot.Axis {
    return {
        stroke: "#64748b", font: "11px system-ui, sans-serif", size, gap: 2,
        grid: { stroke: "#eef2f6", width: 1 }, ticks: { show: false },
    };
}

function make(parent: HTMLElement, title: string, series: uPlot.Series[],
    range: uPlot.Scale.Range, bottom: uPlot.Scale.Range): uPlot {
    const chart = new uPlot({
        title, width: parent.clientWidth, height: HEIGHT, padding: [4, 8, 0, 0],
        legend: { show: false }, cursor: { show: false },
        scales: { x: { time: false, range: bottom }, y: { range } },
        axes: [{ ...axis(20), space: 60 }, { ...axis(38), space: 24 }],
        series: [{}, ...series],
    }, [[], ...series.map(() => [])], parent);
    const fit = () => chart.setSize({ width: parent.clientWidth, height: HEIGHT });
    new ResizeObserver(fit).observe(parent);
    return chart;
}

const line = (stroke: string, width = 1.5): uPlot.Series =>
    ({ stroke, width, points: { show: false } });

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
        const bottom: uPlot.Scale.Range = () => this.seconds();
        this.charts = [
            make(force, "force (N), torque (10 mN·m) against time (s)",
                [line(CSS.force), line(CSS.torque, 1)], above(1), bottom),
            make(energy, "energy (mJ) against time (s)", [line(CSS.energy)], energies, bottom),
            make(depth, "energy (mJ) against depth (mm)",
                [line(CSS.soft), { ...line(CSS.energy), paths: () => null,
                    points: { show: true, size: 4, fill: CSS.energy, stroke: CSS.energy } }],
                energies, (_, min, max) => [min ?? 0, max ?? 1]),
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
        this.torque.push(1e2 * Math.hypot(...frame.torque));
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
