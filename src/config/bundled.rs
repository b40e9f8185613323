//! The examples that are built into the program, so that `tomoswarm sim` works in any folder: the same
//! files as in `configs/` and `scenes/`.

/// Name of the default simulation file.
pub const COURTYARD: &str = "configs/courtyard.sim.toml";

/// The names of the bundled simulations.
pub const NAMES: &[&str] = &["courtyard", "castle", "trees", "house"];

/// Returns the bundled simulation of a name: `courtyard`, `castle`, `trees` or `house`.
pub fn simulation(name: &str) -> Option<&'static str> {
    match name {
        "courtyard" => Some(COURTYARD),
        "castle" => Some("configs/castle.sim.toml"),
        "trees" => Some("configs/trees.sim.toml"),
        "house" => Some("configs/house.sim.toml"),
        _ => None,
    }
}

/// Returns the text of a bundled file by its path from the project's root; steps back (`..`) in the path
/// are followed. Fit to be a [`Loader`](super::Loader), for shapes (`.wrl`) too.
///
/// # Errors
///
/// When no bundled file has this name.
pub fn load(path: &str) -> Result<String, String> {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop();
            }
            name => parts.push(name),
        }
    }
    let text = match parts.join("/").as_str() {
        COURTYARD => include_str!("../../configs/courtyard.sim.toml"),
        "configs/courtyard.venue.toml" => include_str!("../../configs/courtyard.venue.toml"),
        "scenes/courtyard.scene.toml" => include_str!("../../scenes/courtyard.scene.toml"),
        "scenes/courtyard.wrl" => include_str!("../../scenes/courtyard.wrl"),
        "configs/castle.sim.toml" => include_str!("../../configs/castle.sim.toml"),
        "configs/castle.venue.toml" => include_str!("../../configs/castle.venue.toml"),
        "scenes/castle.scene.toml" => include_str!("../../scenes/castle.scene.toml"),
        "scenes/castle.wrl" => include_str!("../../scenes/castle.wrl"),
        "configs/trees.sim.toml" => include_str!("../../configs/trees.sim.toml"),
        "configs/trees.venue.toml" => include_str!("../../configs/trees.venue.toml"),
        "scenes/trees.scene.toml" => include_str!("../../scenes/trees.scene.toml"),
        "scenes/trees.wrl" => include_str!("../../scenes/trees.wrl"),
        "configs/house.sim.toml" => include_str!("../../configs/house.sim.toml"),
        "configs/house.venue.toml" => include_str!("../../configs/house.venue.toml"),
        "scenes/house.scene.toml" => include_str!("../../scenes/house.scene.toml"),
        "scenes/house.wrl" => include_str!("../../scenes/house.wrl"),
        _ => return Err(format!("{path} is not bundled with the program")),
    };
    Ok(text.to_owned())
}
