// Meshes of the page's own: dropped onto it, or chosen.

import type { MeshFile } from "./outbox";
import { element } from "./panel";

export class OwnParts {
    private files: MeshFile[] = [];

    constructor(private readonly play: (files: MeshFile[], unit: string) => void) {
        const chosen = element<HTMLInputElement>("files");
        chosen.onchange = () => void this.take(chosen.files);
        element("choose-files").onclick = () => chosen.click();
        element("unit").onchange = () => this.send();
    }

    /** From now on meshes can be dropped. */
    show(): void {
        if (!element("own").hidden) return;
        element("own").hidden = false;
        const hover = (on: boolean) => document.body.classList.toggle("drop", on);
        window.addEventListener("dragover", (event) => {
            event.preventDefault();
            hover(true);
        });
        window.addEventListener("dragleave", () => hover(false));
        window.addEventListener("drop", (event) => {
            event.preventDefault();
            hover(false);
            void this.take(event.dataTransfer?.files);
        });
    }

    checked(report: string): void {
        element("checked").textContent = report;
    }

    /** One file after two is the first of the next pair. */
    private async take(files: FileList | null | undefined): Promise<void> {
        const read = async (file: File) => ({ name: file.name, bytes: await file.arrayBuffer() });
        const more = await Promise.all([...files ?? []].map(read));
        if (more.length === 0) return;
        this.files = [...(this.files.length < 2 ? this.files : []), ...more].slice(-2);
        this.send();
    }

    private send(): void {
        if (this.files.length > 0) this.play(this.files, element<HTMLSelectElement>("unit").value);
    }
}
