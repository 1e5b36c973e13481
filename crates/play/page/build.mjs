// Bundles the page into dist/, the same bytes for the same lock file; `dist` is checked in.
// `node build.mjs FOLDER local` makes the page that needs no program: the same but for its worker.
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const [out = "dist", kind = "served"] = process.argv.slice(2);
const local = kind === "local";
mkdirSync(out, { recursive: true });
await build({
    entryPoints: { page: "src/main.ts", worker: local ? "src/local.ts" : "src/worker.ts" },
    external: ["./pegfit.js"],
    bundle: true,
    minify: true,
    format: "esm",
    target: "es2022",
    legalComments: "none",
    charset: "utf8",
    outdir: out,
    logLevel: "warning",
});
// What `pegfit play` says in the headers of its replies: nothing comes from, or goes, elsewhere.
const policy = "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; "
    + "img-src 'self' data: blob:; connect-src 'self'; worker-src 'self'; "
    + "base-uri 'none'; form-action 'none'";
const meta = `<meta http-equiv="Content-Security-Policy" content="${policy}">\n`
    + `<meta name="referrer" content="no-referrer">\n`;
const page = readFileSync("src/index.html", "utf8");
writeFileSync(`${out}/index.html`, local ? page.replace("<title>", `${meta}<title>`) : page);
const licences = ["three", "uplot"].map((name) => {
    const { version } = JSON.parse(readFileSync(`node_modules/${name}/package.json`, "utf8"));
    const text = readFileSync(`node_modules/${name}/LICENSE`, "utf8").replaceAll("\r\n", "\n");
    return `${name} ${version}\n\n${text.trim()}\n`;
});
writeFileSync(`${out}/licences.txt`, licences.join(`\n${"-".repeat(70)}\n\n`));
