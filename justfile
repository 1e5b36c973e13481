# One command for contributors: `just` runs what continuous integration runs.
default: check

# Formatting, lints with warnings denied, all tests.
check:
    .ci/run

# The pictures and tables of the paper's three examples, in ./out.
demo:
    cargo run --release -- demo --out out

# The public documentation, warnings denied.
doc:
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps

# Density fields: run time against error on all meshes, ratios to the paper's sums, in ./out.
bench-field *ARGS:
    cargo run --release -p pegfit-benches --bin field -- {{ARGS}}
