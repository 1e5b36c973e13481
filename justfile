# One command for contributors: `just` runs what continuous integration runs.
default: check

# Formatting, lints with warnings denied, all tests.
check:
    .ci/run

# The pictures and tables of the paper's three examples, in ./out.
demo:
    cargo run --release -- demo --out out

# The pictures on the pages, made afresh (minutes; those of `pegfit play` need npm and Chromium);
# `just report` makes those of its page.
figures:
    #!/usr/bin/env bash
    set -euo pipefail
    rm -rf out/figures
    cargo build --release -p pegfit
    target/release/pegfit demo --out out/figures
    for name in density overlap score energy-x energy-rz collision snap; do
        cp "out/figures/rectangular-$name.png" "docs/figures/$name.png"
    done
    target/release/pegfit field fixtures/combined_hole.obj --unit m --slice y=0.001 \
        --png docs/figures/slice.png --skeleton docs/figures/skeleton.png
    PEGFIT=target/release/pegfit PEGFIT_PICTURES=out/figures tests/play/run story telephone
    for name in play play-snap play-small; do
        cp "out/figures/$name.png" "docs/figures/$name.png"
    done

# Draws the modules and their arrows in docs/architecture.md afresh.
modules:
    PEGFIT_DRAW=1 cargo test -q -p pegfit-structure the_picture

# The site, in ./out/site: what stands on the pages is run, tutorials are executed, warnings denied.
# After `just wasm`, PEGFIT_WASM=out/wasm puts the page of `pegfit play` on its first page.
site *ARGS:
    mkdir -p out
    PEGFIT_SITE=out/site tests/site/run {{ARGS}}

# What the command says of itself, written to docs/command-line.md.
command-line:
    PEGFIT_DRAW=1 cargo test -q -p pegfit --test cli command_line

# The size of this workspace: lines, files and public names of each crate, crates in the command;
# `just house --times` adds the seconds of a clean build and of the tests.
house *ARGS:
    cargo run -q -p pegfit-structure --bin house -- {{ARGS}}

# Sets the one version: crates, citation, wheel.
version NEW:
    sed -i '/^\[workspace.package\]/,/^\[/s/^version = .*/version = "{{NEW}}"/' Cargo.toml
    sed -i '/{ path = "/s/version = "[^"]*"/version = "{{NEW}}"/' Cargo.toml
    sed -i 's/^version: .*/version: {{NEW}}/' CITATION.cff
    cargo update --workspace

# What would be published, in ./out/dist, installed from there and tried (half an hour; needs Python);
# licences, what is there twice, sources and advisories (needs `cargo install cargo-deny`).
release *ARGS:
    PEGFIT_DIST=out/dist tests/release/run {{ARGS}}
    cargo deny check

# Wheels for x86-64 and 64-bit ARM, in ./out/dist, each asked, their answers compared (half an hour);
# says what is missing where it cannot run.
wheels *ARGS:
    PEGFIT_DIST=out/dist tests/release/wheels {{ARGS}}

# Whether all that is installed compiles for Windows and macOS: types only, nothing is linked or run.
cross:
    tests/release/cross

# The container of the command, built and run; says what is missing where it cannot.
container:
    tests/release/container

# The public documentation, warnings denied.
doc:
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

# Ten minutes of fuzzing per target (needs a nightly toolchain and `cargo install cargo-fuzz`).
fuzz seconds="600":
    #!/usr/bin/env bash
    set -euo pipefail
    cd fuzz
    for target in $(cargo +nightly fuzz list); do
        mkdir -p "corpus/$target"
        cargo +nightly fuzz run "$target" "corpus/$target" "seeds/$target" -- \
            -max_total_time={{seconds}} -timeout=30 -rss_limit_mb=4096 -max_len=4096
    done

# Signed distance beside Open3D, libigl and parry3d (needs benches/peers/requirements.txt).
peers:
    cargo clippy -p pegfit-benches --features peers --bin peers -- -D warnings
    cargo build --release -p pegfit-benches --features peers --bin peers
    python3 benches/peers/peers.py

# The ten million queries that the tests leave out.
stress:
    cargo test --release -p sdf-grid --test it stress:: -- --include-ignored --nocapture

# The kernels of correlations in Miri, without vector instructions: every access to memory checked
# (needs `rustup +nightly component add miri`).
miri:
    MIRIFLAGS="-Zmiri-disable-isolation" cargo +nightly miri test -p fft-correlate --features scalar \
        --lib correlate::kernels

# Devices against a real kernel, in qemu; says what is missing where it cannot run.
hid-vm:
    tests/hid-vm/run

# Bundles the page of `pegfit play` afresh; what it makes is checked in (needs npm).
page:
    cd crates/play/page && npm ci --no-audit --no-fund && npx tsc --noEmit && node build.mjs

# The page of `pegfit play` that needs no program, in ./out/wasm; any web server serves it (minutes;
# needs rustup and npm). `just play local` opens it in Chromium.
wasm *ARGS:
    crates/play-wasm/build {{ARGS}}

# The page of `pegfit play` in Chromium; says what is missing where it cannot run.
play *ARGS:
    tests/play/run {{ARGS}}

# The SIMD code on 64-bit ARM, emulated; says what is missing where it cannot run.
arm *ARGS:
    tests/arm/run {{ARGS}}

# Long tests that the suite leaves out: docking in more frames, accuracy in contact at more clearances.
long:
    cargo test --release -p fft-correlate --lib -- --ignored --nocapture dock::
    cargo test --release -p fft-correlate --test it -- --ignored --nocapture mating:: tolerance::
    cargo test --release -p pegfit-benches --bin contact -- --ignored --nocapture

# Long tests that the suite leaves out: 50 kills of a bake, ten million queries.
stress-tables:
    cargo test --release -p fft-correlate --test it -- table_queries --ignored --nocapture
    cargo test --release -p pegfit --test cli -- kill --include-ignored --nocapture

# Tables and field caches under attack, in full: every bit of every file flipped, chunks exchanged
# within tables and between them, hostile chunks and files; then, if given, SECONDS of fuzzing tables
# (needs a nightly toolchain and `cargo install cargo-fuzz`).
attacks seconds="0":
    #!/usr/bin/env bash
    set -euo pipefail
    cargo test --release -p fft-correlate --test it -- store_seal store_damage --include-ignored --nocapture
    cargo test --release -p sdf-grid --test it -- field_cache
    cargo test --release -p pegfit --test cli -- sealed --nocapture
    if [ {{seconds}} -gt 0 ]; then
        cd fuzz
        mkdir -p corpus/table
        cargo +nightly fuzz run table corpus/table seeds/table -- \
            -max_total_time={{seconds}} -timeout=30 -rss_limit_mb=4096 -max_len=8192
    fi

# Tables in object stores: builds with the feature `cloud`, bakes and reads through a small S3 server.
cloud:
    cargo clippy -p fft-correlate -p pegfit --features pegfit/cloud --all-targets -- -D warnings
    cargo test -p fft-correlate --features cloud --test it store_memory
    cargo test -p pegfit --features cloud --test cli cloud

# The Python package in full: an optimized wheel, slow tests, types, optional packages; PYTHONS are
# interpreters (default: python3).
python *PYTHONS:
    tests/python/run full {{PYTHONS}}

# Contact by MuJoCo, coal, FCL, Drake and pegfit, side by side, hours (`--quick`: minutes; `--minutes 3`:
# a piece; `--page docs/comparison.md`: written there); needs the package and
# benches/peers/contact-requirements.txt.
contact-peers *ARGS:
    python3 benches/peers/contact.py {{ARGS}}

# Rates of the Python package, wherever it is installed, beside those of Rust and of the command.
python-bench PYTHON="python3":
    cargo build --release -p pegfit-benches --bin rate
    PEGFIT_RATE=target/release/rate {{PYTHON}} benches/python/query.py

# Tables by Slurm, mpirun and a Kubernetes Job's command; tables in zarr-python and xarray.
batch:
    cargo build --release
    tests/cluster/run.sh
    tests/interop/run.sh

# docs/report.md: times, errors and charts of this machine, in minutes; `just report full` in hours.
# Words: full, fftw, only=SECTION, parts=DIR (the IndustReal meshes).
report *ARGS:
    cargo build --release -p pegfit-benches
    cargo run --release -p pegfit-benches --bin report -- {{ARGS}}

# Where generated joints of machines belong, and which joints they are: pairs as they lie and with each
# part turned by itself, in ./out (`just docking-joints 1..4 --only nut`).
docking-joints SEEDS="1..2" *ARGS:
    cargo run --release -p pegfit-benches --bin docking -- --joints {{SEEDS}} --starts 1 \
        --kinds "in place,both" {{ARGS}}

# Assemblies made from numbers, and those of folders, put together from scattered parts, in ./out
# (`just assemblies --frames 1..4 --only box`; `--page docs/assemble.md`: written there).
assemblies *ARGS:
    cargo run --release -p pegfit-benches --bin assemble -- {{ARGS}}

# Time and memory of small parts beside large ones, in ./out (`just bench-reach PARTS_DIR --folder PAIRS`).
bench-reach *ARGS:
    cargo run --release -p pegfit-benches --bin reach -- {{ARGS}}

# Contact without a lattice: long tests, then how sure it is (`just truth --write` keeps it instead).
truth *ARGS:
    cargo test --release -p pegfit-truth -- --include-ignored
    cargo run --release -p pegfit-benches --bin truth -- {{ARGS}}

# Energies and wrenches at random poses and in contact, in several frames, in ./out.
bench-contact *ARGS:
    cargo run --release -p pegfit-benches --bin contact -- {{ARGS}}

# Insertion paths, pairs turned and shifted, in ./out.
bench-path *ARGS:
    cargo run --release -p pegfit-benches --bin path -- {{ARGS}}

# Paths by OMPL's planners with coal beside those of pegfit, into docs/path.md, hours (minutes with
# `just path-peers 1 --only peg`); needs benches/peers/path-requirements.txt.
path-peers FRAMES="20" *ARGS:
    cargo build --release -p pegfit -p pegfit-benches --bin pegfit --bin path
    rm -rf out/path-scenes
    target/release/path --scenes out/path-scenes --frames {{FRAMES}} {{ARGS}}
    python3 benches/peers/path.py out/path-scenes --pegfit target/release/pegfit \
        --shrink 0.5 0.65 0.8 0.9 1 --page docs/path.md

# Overlaps along paths against exact booleans of the meshes (`just path-overlap 1 --only peg`: minutes);
# needs benches/peers/path-requirements.txt.
path-overlap FRAMES="20" *ARGS:
    cargo build --release -p pegfit -p pegfit-benches --bin pegfit --bin path
    rm -rf out/path-scenes
    target/release/path --scenes out/path-scenes --frames {{FRAMES}} {{ARGS}}
    python3 benches/peers/overlap.py out/path-scenes --pegfit target/release/pegfit

# Density fields: run time against error on all meshes, ratios to the paper's sums, in ./out.
bench-field *ARGS:
    cargo run --release -p pegfit-benches --bin field -- {{ARGS}}

# Logs as Parquet against logs as CSV: a build with the feature takes a minute more.
parquet:
    cargo clippy -p pegfit --features parquet --all-targets -- -D warnings
    cargo clippy -p haptic --features parquet --all-targets -- -D warnings
    cargo test -p haptic --features parquet --lib -- parquet

# Error against time and memory of tables and of the direct evaluator, frontiers marked, in ./out.
pareto *ARGS:
    cargo run --release -p pegfit-benches --bin pareto -- {{ARGS}}
