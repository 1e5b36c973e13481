//! A session of two parts, as a worker of the page steps it.

use std::error::Error;

use pegfit_play::{LocalSession, PlayError};
use pegfit_scene::SceneSetup;
use sdf_grid::shapes::PegInHole;
use serde_json::json;
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::meshes::Meshes;
use crate::opened;

/// The names of the paper's pairs, as a JSON list.
#[wasm_bindgen]
pub fn pairs() -> String {
    json!(PegInHole::ALL.map(PegInHole::name)).to_string()
}

/// This version of pegfit.
#[wasm_bindgen]
pub fn version() -> String {
    env!("CARGO_PKG_VERSION").to_owned()
}

/// A session of two parts. Messages are those of `docs/play.md`.
#[wasm_bindgen]
pub struct Play(LocalSession);

#[wasm_bindgen]
impl Play {
    /// The paper's pair of this number, as session `number`.
    ///
    /// # Errors
    /// If there is no such pair.
    pub fn paper(pair: usize, number: u32) -> Result<Self, JsError> {
        let shape = PegInHole::ALL.get(pair).copied();
        let shape = shape.ok_or_else(|| JsError::new(&format!("there is no pair {pair}")))?;
        Self::begin(opened::paper(shape), number, pair)
    }

    /// Two meshes that fit as they lie, as session `number`, after the paper's pairs.
    ///
    /// # Errors
    /// If there are not two that can be used, or their fields cannot be had.
    pub fn own(meshes: &Meshes, number: u32) -> Result<Self, JsError> {
        let Some(pair) = meshes.pair() else {
            return Err(JsError::new("expected two meshes that can be used"));
        };
        let setup = opened::own(pair, meshes.unit());
        Self::begin(setup, number, PegInHole::ALL.len())
    }

    fn begin(
        setup: Result<SceneSetup, PlayError>,
        number: u32,
        pair: usize,
    ) -> Result<Self, JsError> {
        let opened = setup.and_then(|setup| opened::open(setup, number, pair));
        opened
            .map(Self)
            .map_err(|error| JsError::new(&words(&error)))
    }

    /// What the page needs to know, as JSON.
    pub fn description(&self) -> String {
        self.0.description().to_string()
    }

    /// Does the tick that is due; false if none is.
    pub fn step(&mut self) -> bool {
        self.0.step()
    }

    /// Handles a request of the page; false if it is none.
    pub fn handle(&mut self, request: &[u8]) -> bool {
        self.0.handle(request)
    }

    /// The newest frame, once there was a tick.
    pub fn frame(&mut self) -> Option<Vec<u8>> {
        self.0.frame().map(Vec::from)
    }

    /// The bytes called `name`, if there is such a thing.
    pub fn bytes(&self, name: &str) -> Option<Vec<u8>> {
        self.0.bytes(name)
    }

    /// Looks for poses in which the part fits; what the page is told, as JSON.
    pub fn dock(&self) -> String {
        self.0.dock().to_string()
    }
}

/// An error with its causes.
fn words(error: &dyn Error) -> String {
    let mut words = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        let text = error.to_string();
        // Some say what their cause says.
        if !words.contains(&text) {
            words += &format!(": {text}");
        }
        cause = error.source();
    }
    words
}
