//! Examples at the end of a command's help.

/// The end of a command's help: examples, one to a line.
macro_rules! examples {
    ($($name:ident: $($line:literal)+;)*) => {$(
        pub(crate) const $name: &str = concat!("Examples:\n", $("  ", $line, "\n",)+
            "\nManual: ", env!("CARGO_PKG_REPOSITORY"));
    )*};
}

examples! {
    DEMO: "pegfit demo" "pegfit demo --out /tmp/demo";
    CHECK: "pegfit check hole.stl peg.stl" "pegfit check bracket.step --solid 2" "pegfit check scene.toml";
    SCENE: "pegfit scene product.step --moving lid -o scene.toml"
        "pegfit scene robot.urdf --moving gripper -o scene.toml";
    FIELD: "pegfit field peg.stl -o peg.vti" "pegfit field peg.stl --png peg.png";
    BAKE: "pegfit bake scene.toml -o scene.zarr" "pegfit bake scene.toml -o scene.zarr --resume"
        "pegfit bake scene.toml -o scene.zarr --rank 3 --size 8";
    TABLE: "pegfit table scene.zarr" "pegfit table scene.zarr --json";
    VERIFY: "pegfit verify scene.zarr --scene scene.toml";
    SCORE: "pegfit score --scene scene.toml --poses poses.csv -o scores.csv"
        "pegfit score --table scene.zarr --poses poses.csv";
    DOCK: "pegfit dock scene.toml" "pegfit dock scene.toml --top 3 -o poses.csv";
    SCREEN: "pegfit screen plate.step --library pins/ -o fits.csv"
        "pegfit screen plate.step --library pins/ -o fits.csv --resume";
    PATH: "pegfit path scene.toml --html path.html" "pegfit path scene.toml -o path.csv";
    DISASSEMBLE: "pegfit disassemble scene.toml --html order.html";
    ASSEMBLE: "pegfit assemble box.stl lid.stl screw*.stl -o assembly.toml"
        "pegfit assemble parts/ -o assembly.toml --html assembly.html";
    PLAY: "pegfit play scene.toml" "pegfit play assembly.toml --no-open";
    FEEL: "pegfit feel scene.toml --table scene.zarr" "pegfit feel scene.toml --device auto";
    DEVICES: "pegfit devices" "pegfit devices --json";
    PLOT: "pegfit plot force scene.toml -o force.png";
    COMPLETIONS: "pegfit completions bash > /etc/bash_completion.d/pegfit";
    MAN: "pegfit man /usr/local/share/man/man1";
}

#[cfg(test)]
mod tests {
    use clap::{CommandFactory, Parser};

    use crate::args::Arguments;

    #[test]
    fn every_command_has_examples_and_all_of_them_parse() {
        let command = Arguments::command();
        for each in command.get_subcommands() {
            let text = each.get_after_help().map(ToString::to_string);
            let text = text.unwrap_or_else(|| panic!("{}: no examples", each.get_name()));
            let lines: Vec<&str> = text.lines().filter(|l| l.starts_with("  ")).collect();
            assert!(!lines.is_empty(), "{}", each.get_name());
            for line in lines {
                let words = line.split_whitespace().take_while(|word| *word != ">");
                let words: Vec<&str> = words.collect();
                assert_eq!(words[..2], ["pegfit", each.get_name()]);
                if let Err(said) = Arguments::try_parse_from(&words) {
                    panic!("{line}: {said}");
                }
            }
        }
    }
}
