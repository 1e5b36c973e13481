// Messages of the server and to it, byte by byte: docs/play.md lists the offsets.

/** x y z in metres, then a unit quaternion x y z w. */
export type Pose = [number, number, number, number, number, number, number];
export type Vector = [number, number, number];

export interface Frame {
    isHand: boolean;
    flags: number;
    stage: number;
    time: number;
    /** Milliseconds since 1970 at which the tick began. */
    wall: number;
    hand: Pose;
    object: Pose;
    force: Vector;
    torque: Vector;
    energy: number;
    coverage: number;
    gain: number;
    depth: number;
    rate: number;
    /** Mean and worst, µs. */
    latency: [number, number];
    lateness: [number, number];
    recorded: number;
    ticks: number;
    missed: number;
    doing: number;
    pages: number;
    isHeld: boolean;
    isRecording: boolean;
    flagged: number[];
}

const FRAME_BYTES = 216;

/** Flags of a tick: `EVENTS` has words for each. */
const FLAGS = 15;

export function readFrame(buffer: ArrayBuffer): Frame | undefined {
    const view = new DataView(buffer);
    if (buffer.byteLength !== FRAME_BYTES || view.getUint8(0) !== 1) return undefined;
    const float = (at: number) => view.getFloat32(at, true);
    const floats = (at: number, count: number) =>
        Array.from({ length: count }, (_, i) => float(at + 4 * i));
    const count = (at: number) => view.getUint32(at, true);
    return {
        isHand: view.getUint8(1) === 1,
        flags: view.getUint16(2, true),
        stage: count(4),
        time: view.getFloat64(8, true),
        wall: view.getFloat64(16, true),
        hand: floats(24, 7) as Pose,
        object: floats(52, 7) as Pose,
        force: floats(80, 3) as Vector,
        torque: floats(92, 3) as Vector,
        energy: float(104),
        coverage: float(108),
        gain: float(112),
        depth: float(116),
        rate: float(120),
        latency: [float(124), float(128)],
        lateness: [float(132), float(136)],
        recorded: float(140),
        ticks: count(144),
        missed: count(148),
        doing: view.getUint8(152),
        pages: view.getUint8(153),
        isHeld: view.getUint8(154) === 1,
        isRecording: view.getUint8(155) === 1,
        flagged: Array.from({ length: FLAGS }, (_, i) => count(156 + 4 * i)),
    };
}

function posed(kind: number, pose: Pose): ArrayBuffer {
    const view = new DataView(new ArrayBuffer(29));
    view.setUint8(0, kind);
    pose.forEach((value, i) => view.setFloat32(1 + 4 * i, value, true));
    return view.buffer as ArrayBuffer;
}

const bytes = (...values: number[]) => new Uint8Array(values).buffer as ArrayBuffer;

export const request = {
    beat: () => bytes(0),
    hold: (pose: Pose) => posed(1, pose),
    letGo: () => bytes(2),
    collision: () => bytes(3, 0),
    snap: () => bytes(3, 1),
    place: (pose: Pose) => posed(4, pose),
    take: () => bytes(5),
    choose: (pair: number) => bytes(6, pair),
    record: (on: boolean) => bytes(7, on ? 1 : 0),
    replay: () => bytes(8),
    dock: () => bytes(9),
    follow: () => bytes(10),
};

/** The first message. */
export interface Hello {
    /** Titles of the pairs to choose among. */
    pairs: string[];
    /** The page computes by itself, and takes meshes. */
    local?: boolean;
}

/** The pair of this number is being made ready. */
export interface Loading {
    loading: string;
    pair: number;
    /** What is being done, and the share of it that is done. */
    progress?: [string, number];
}

/** A place to jump to. */
export interface Place {
    title: string;
    note: string;
    pose: Pose;
}

/** What the server says of a stage. */
export interface Stage {
    stage: number;
    pair: number;
    /** Whether there is a path that the operator can follow. */
    path?: boolean;
    title?: string;
    /** Names of the parts that stay; mesh/0 ... are theirs, mesh/moving is the other's. */
    fixed?: string[];
    moving?: string;
    seated?: Pose;
    /** Direction of the path, its length, and the point of the part that the hand holds. */
    axis?: Vector;
    depth?: number;
    grip?: Vector;
    /** The coordinate axis across which parts are cut open. */
    cut?: number;
    places?: Place[];
    /** Energy (J) against depth (m) on the straight insertion path. */
    profile?: [number, number][];
    /** Greatest force (N) and torque (N·m) that the loop shows. */
    limits?: [number, number];
    source?: string;
    /** Of a table, what it states; of sums `link.bytes("error")` computes it. */
    error?: string | null;
    coarser?: string;
}

export interface Docked {
    docking?: boolean;
    docked?: Place[];
    failed?: string;
}
