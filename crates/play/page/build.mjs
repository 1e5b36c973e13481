// Bundles the page into dist/, the same bytes for the same lock file; `dist` is checked in.
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const out = process.argv[2] ?? "dist";
mkdirSync(out, { recursive: true });
await build({
    entryPoints: { page: "src/main.ts", worker: "src/worker.ts" },
    bundle: true,
    minify: true,
    format: "esm",
    target: "es2022",
    legalComments: "none",
    charset: "utf8",
    outdir: out,
    logLevel: "warning",
});
copyFileSync("src/index.html", `${out}/index.html`);
const licences = ["three", "uplot"].map((name) => {
    const { version } = JSON.parse(readFileSync(`node_modules/${name}/package.json`, "utf8"));
    const text = readFileSync(`node_modules/${name}/LICENSE`, "utf8").replaceAll("\r\n", "\n");
    return `${name} ${version}\n\n${text.trim()}\n`;
});
writeFileSync(`${out}/licences.txt`, licences.join(`\n${"-".repeat(70)}\n\n`));
