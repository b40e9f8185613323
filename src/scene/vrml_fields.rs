//! Which fields the nodes have that are read, by ISO/IEC 14772-1:1997 (VRML97), clause 6: so a misspelt one is told from one
//! that means nothing to us.

/// Returns the fields of a node by the standard; `None` for a node that is not read.
fn standard_fields(node_type: &str) -> Option<&'static [&'static str]> {
    Some(match node_type {
        "Group" => &[
            "addChildren",
            "removeChildren",
            "children",
            "bboxCenter",
            "bboxSize",
        ],
        "Collision" => &[
            "addChildren",
            "removeChildren",
            "children",
            "collide",
            "bboxCenter",
            "bboxSize",
            "proxy",
            "collideTime",
        ],
        "Transform" => &[
            "addChildren",
            "removeChildren",
            "center",
            "children",
            "rotation",
            "scale",
            "scaleOrientation",
            "translation",
            "bboxCenter",
            "bboxSize",
        ],
        "Inline" => &["url", "bboxCenter", "bboxSize"],
        "Shape" => &["appearance", "geometry"],
        "Box" => &["size"],
        "Cone" => &["bottomRadius", "height", "side", "bottom"],
        "Cylinder" => &["bottom", "height", "radius", "side", "top"],
        "Sphere" => &["radius"],
        "Coordinate" => &["point"],
        "IndexedFaceSet" => &[
            "set_colorIndex",
            "set_coordIndex",
            "set_normalIndex",
            "set_texCoordIndex",
            "color",
            "coord",
            "normal",
            "texCoord",
            "ccw",
            "colorIndex",
            "colorPerVertex",
            "convex",
            "coordIndex",
            "creaseAngle",
            "normalIndex",
            "normalPerVertex",
            "solid",
            "texCoordIndex",
        ],
        "ElevationGrid" => &[
            "set_height",
            "color",
            "normal",
            "texCoord",
            "height",
            "ccw",
            "colorPerVertex",
            "creaseAngle",
            "normalPerVertex",
            "solid",
            "xDimension",
            "xSpacing",
            "zDimension",
            "zSpacing",
        ],
        "Extrusion" => &[
            "set_crossSection",
            "set_orientation",
            "set_scale",
            "set_spine",
            "beginCap",
            "ccw",
            "convex",
            "creaseAngle",
            "crossSection",
            "endCap",
            "orientation",
            "scale",
            "solid",
            "spine",
        ],
        _ => return None,
    })
}

/// Returns what to say of a field that a node does not have; `None` when it has it.
pub(super) fn strange_field(node_type: &str, field: &str) -> Option<String> {
    let fields = standard_fields(node_type)?;
    if fields.contains(&field) {
        return None;
    }
    let shown: String = field.chars().take(40).collect();
    // Events that only come in are nothing that a file says.
    let said: Vec<&str> = fields
        .iter()
        .filter(|name| {
            !["set_", "add", "remove"]
                .iter()
                .any(|event| name.starts_with(event))
        })
        .copied()
        .collect();
    Some(format!(
        "`{shown}` is no field of {node_type} and is skipped; expected {}",
        said.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_of_the_standard_is_not_strange() {
        assert_eq!(strange_field("Extrusion", "creaseAngle"), None);
        assert_eq!(strange_field("Viewpoint", "whatever"), None);
    }

    #[test]
    fn a_misspelt_field_is_named_with_those_of_its_node() {
        assert_eq!(
            strange_field("Box", "sise").as_deref(),
            Some("`sise` is no field of Box and is skipped; expected size")
        );
        let said = strange_field("Group", "child").unwrap_or_default();
        assert!(
            said.ends_with("expected children, bboxCenter, bboxSize"),
            "{said}"
        );
    }
}
