//! The example that is built into the program, so that `tomoswarm sim` works in any folder: the same
//! files as in `configs/` and `scenes/`.

/// Name of the default simulation file.
pub const COURTYARD: &str = "configs/courtyard.sim.toml";

/// Gives the text of a bundled file by its path from the project's root; steps back (`..`) in the path
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
        _ => return Err(format!("{path} is not bundled with the program")),
    };
    Ok(text.to_owned())
}
