//! Options of every command.

use std::ffi::OsString;

use clap::{ArgAction, Args, ColorChoice, ValueEnum};

/// Options of every command.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Options of every command")]
pub(crate) struct Global {
    /// Worker threads [default: one per core]
    #[arg(long, global = true, value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Most memory to use, GiB [default: nine tenths of what is available]
    #[arg(long, global = true, value_name = "GIB")]
    pub(crate) memory: Option<f64>,
    /// No progress bars and no remarks
    #[arg(long, short, global = true)]
    pub(crate) quiet: bool,
    /// Print what the libraries are doing; -vv prints more, -vvv all
    #[arg(long, short, global = true, action = ArgAction::Count, conflicts_with = "quiet")]
    pub(crate) verbose: u8,
    /// Print the result, or what went wrong, as JSON
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Colours: on a terminal, always or never
    #[arg(
        long,
        global = true,
        value_name = "WHEN",
        default_value = "auto",
        hide_possible_values = true
    )]
    pub(crate) color: Coloring,
}

/// When to print in colours.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Coloring {
    /// On a terminal, unless `NO_COLOR` is set.
    Auto,
    /// Into files and pipes as well.
    Always,
    /// Never.
    Never,
}

impl Coloring {
    /// What the words of a command line say, before they are parsed: mistakes in them have colours, too.
    pub(crate) fn of(words: &[OsString]) -> Self {
        let mut words = words.iter().filter_map(|word| word.to_str());
        let mut chosen = Self::Auto;
        while let Some(word) = words.next() {
            let value = match word.split_once('=') {
                Some(("--color", value)) => Some(value),
                None if word == "--color" => words.next(),
                _ => None,
            };
            let value = value.and_then(|value| Self::from_str(value, false).ok());
            chosen = value.unwrap_or(chosen);
        }
        chosen
    }

    /// Makes errors, progress and remarks follow it.
    pub(crate) fn apply(self) {
        match self {
            Self::Auto => {}
            Self::Always | Self::Never => {
                console::set_colors_enabled(self == Self::Always);
                console::set_colors_enabled_stderr(self == Self::Always);
            }
        }
    }
}

impl From<Coloring> for ColorChoice {
    fn from(coloring: Coloring) -> Self {
        match coloring {
            Coloring::Auto => Self::Auto,
            Coloring::Always => Self::Always,
            Coloring::Never => Self::Never,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_known_before_the_words_are_parsed() {
        let of = |words: &[&str]| Coloring::of(&words.iter().map(Into::into).collect::<Vec<_>>());
        assert_eq!(of(&["pegfit", "dock"]), Coloring::Auto);
        assert_eq!(of(&["pegfit", "--color", "never", "dock"]), Coloring::Never);
        assert_eq!(of(&["pegfit", "dock", "--color=always"]), Coloring::Always);
        assert_eq!(of(&["pegfit", "--color", "green"]), Coloring::Auto);
    }
}
