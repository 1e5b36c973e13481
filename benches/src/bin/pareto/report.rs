//! The tables and the chart.

use pegfit_benches::frontier::{Kind, ParetoPanel, draw, frontier};
use pegfit_benches::table::{Table, percent, significant};
use pegfit_benches::{Arguments, Outcome};

use crate::Measured;

const COLUMNS: [&str; 16] = [
    "kind",
    "sampling",
    "h, mm",
    "step, degrees",
    "numbers",
    "bake, s",
    "query, µs",
    "MiB",
    "wrench, %",
    "best for",
    "E, %",
    "F, %",
    "T, %",
    "E, contact, %",
    "F, contact, %",
    "T, contact, %",
];

const ABOUT: &str = "Those of all combinations that no other beats in time (t) or memory (m); \
    `pareto-all.csv` has every one. `wrench` is the rms of four relative errors: force and torque \
    (of their rms) at random poses and along paths in contact (sliding in, pressing from wall to \
    wall, turning in the hole); energy errors are relative to its range. `bake` counts the \
    processor seconds of fields and table on all threads, `query` is the median of the fastest of \
    three. Some points of a frontier are luck: where faces happen to lie in cells.";

/// `title` says of what; `reference` how sure the truth is.
pub(crate) fn publish(
    found: &[Measured],
    title: &str,
    reference: &Table,
    arguments: &Arguments,
) -> Outcome<()> {
    let points = |cost: fn(&Measured) -> f64| -> Vec<(f64, f64)> {
        found.iter().map(|m| (cost(m), m.wrench())).collect()
    };
    let by_time = frontier(&points(|m| m.query));
    let by_memory = frontier(&points(|m| m.bytes as f64));
    let mut all = Table::new("pareto-all", &format!("{title}: everything"), "", &COLUMNS);
    let mut best = Table::new(
        "pareto",
        &format!("{title}: efficient choices"),
        ABOUT,
        &COLUMNS,
    );
    for (index, m) in found.iter().enumerate() {
        let mut marks = Vec::new();
        marks.extend(by_time.contains(&index).then_some("t"));
        marks.extend(by_memory.contains(&index).then_some("m"));
        let cells = cells(m, &marks.join(", "));
        if !marks.is_empty() {
            best.push(cells.clone());
        }
        all.push(cells);
    }
    print!("{}", all.to_text());
    all.write_csv(&arguments.out.join("pareto-all.csv"))?;
    arguments.publish(&by_spacing(found, title), None)?;
    arguments.publish(reference, None)?;
    arguments.publish(&best, Some(&chart(found)?))
}

fn cells(m: &Measured, marks: &str) -> [String; 16] {
    let [mm, scheme, step, numbers] = m.setting.clone();
    let mut errors = m.errors.iter().flatten().map(|e| percent(*e));
    let mut error = || errors.next().unwrap_or_default();
    [
        m.kind.clone(),
        scheme,
        mm,
        step,
        numbers,
        significant(m.bake, 3),
        significant(1e6 * m.query, 3),
        significant(m.bytes as f64 / f64::from(1 << 20), 3),
        percent(m.wrench()),
        marks.to_owned(),
        error(),
        error(),
        error(),
        error(),
        error(),
        error(),
    ]
}

/// What the lattice costs: wrench errors of the most exact evaluation and of the usual table.
fn by_spacing(found: &[Measured], title: &str) -> Table {
    const STEP: &str = "4";
    let usual = |m: &&Measured| match m.kind.as_str() {
        "direct, every cell" => true,
        "table" => m.setting[2] == STEP && m.setting[3] == "float16",
        _ => false,
    };
    let about = "Wrench error in per cent (defined with the next table) of direct evaluation with \
        every cell a point, and of float16 tables with rotations 4 degrees apart, by \
        spacing and by how densities are put on it.";
    let columns = ["kind", "sampling", "h, mm", "wrench, %"];
    let mut table = Table::new(
        "spacing",
        &format!("{title}: what the lattice costs"),
        about,
        &columns,
    );
    for m in found.iter().filter(usual) {
        let [mm, scheme, ..] = m.setting.clone();
        table.push([m.kind.clone(), scheme, mm, percent(m.wrench())]);
    }
    table
}

fn chart(found: &[Measured]) -> Outcome<Vec<u8>> {
    let panel = |title: &str, cost: &str, of: fn(&Measured) -> f64| {
        let mut kinds: Vec<Kind> = Vec::new();
        for m in found {
            let point = (of(m), m.wrench());
            match kinds.iter_mut().find(|k| k.label == m.kind) {
                Some(kind) => kind.points.push(point),
                None => kinds.push(Kind {
                    label: m.kind.clone(),
                    points: vec![point],
                }),
            }
        }
        ParetoPanel {
            title: title.into(),
            cost: cost.into(),
            error: "the wrench error".into(),
            kinds,
        }
    };
    draw(&[
        panel(
            "Error of the wrench against time of a query",
            "seconds",
            |m| m.query,
        ),
        panel("Error of the wrench against memory", "bytes", |m| {
            m.bytes as f64
        }),
    ])
}
