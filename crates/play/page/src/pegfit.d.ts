// What `just wasm` makes of crates/play-wasm, as far as the page uses it.

export default function init(program: { module_or_path: URL }): Promise<unknown>;
export function pairs(): string;
export class Meshes {
    constructor(unit: string);
    add(name: string, bytes: Uint8Array): boolean;
    report(): string;
    isPair(): boolean;
    free(): void;
}
export class Play {
    static paper(pair: number, number: number): Play;
    static own(meshes: Meshes, number: number): Play;
    description(): string;
    step(): boolean;
    handle(request: Uint8Array): boolean;
    frame(): Uint8Array | undefined;
    bytes(name: string): Uint8Array | undefined;
    dock(): string;
    free(): void;
}
