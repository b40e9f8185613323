//! The JSON schemas of a recording's messages: two of our own for replay, and four that Foxglove draws
//! (<https://docs.foxglove.dev/docs/visualization/message-schemas>).

/// The kind of a message.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Schema {
    /// A step of an actor.
    Step,
    /// An actor as it was.
    Snapshot,
    /// Where a vehicle is.
    Pose,
    /// A map or an image.
    Grid,
    /// A line for people.
    Log,
}

const TIME: &str = r#""timestamp":{"type":"object","title":"time","properties":{"sec":{"type":"integer","minimum":0},"nsec":{"type":"integer","minimum":0,"maximum":999999999}}}"#;
const POSE: &str = r#""pose":{"type":"object","title":"foxglove.Pose","properties":{"position":{"type":"object","title":"foxglove.Vector3","properties":{"x":{"type":"number"},"y":{"type":"number"},"z":{"type":"number"}}},"orientation":{"type":"object","title":"foxglove.Quaternion","properties":{"x":{"type":"number"},"y":{"type":"number"},"z":{"type":"number"},"w":{"type":"number"}}}}}"#;

impl Schema {
    /// Returns the name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Schema::Step => "tomoswarm.Step",
            Schema::Snapshot => "tomoswarm.Snapshot",
            Schema::Pose => "foxglove.PoseInFrame",
            Schema::Grid => "foxglove.Grid",
            Schema::Log => "foxglove.Log",
        }
    }

    /// Returns the JSON schema.
    pub(crate) fn text(self) -> String {
        let properties = match self {
            Schema::Step => r#""now_ns":{"type":"integer","description":"nanoseconds since the node started"},"input":{"description":"the input"},"packed_input":{"type":"string","contentEncoding":"base64","description":"the input, when JSON cannot hold it"},"woken":{"type":"string","description":"the reason of the deadline, in place of input"},"outputs":{"type":"array","description":"the outputs, in order"},"fault":{"type":"string","description":"why the actor could not go on"}"#.to_owned(),
            Schema::Snapshot => r#""now_ns":{"type":"integer","description":"nanoseconds since the node started"},"packed":{"type":"string","contentEncoding":"base64","description":"the actor, for the same version of tomoswarm"}"#.to_owned(),
            Schema::Pose => format!(r#"{TIME},"frame_id":{{"type":"string"}},{POSE}"#),
            Schema::Grid => format!(
                r#"{TIME},"frame_id":{{"type":"string"}},{POSE},"column_count":{{"type":"integer","minimum":0}},"cell_size":{{"type":"object","title":"foxglove.Vector2","properties":{{"x":{{"type":"number"}},"y":{{"type":"number"}}}}}},"row_stride":{{"type":"integer","minimum":0}},"cell_stride":{{"type":"integer","minimum":0}},"fields":{{"type":"array","items":{{"type":"object","title":"foxglove.PackedElementField","properties":{{"name":{{"type":"string"}},"offset":{{"type":"integer","minimum":0}},"type":{{"title":"foxglove.NumericType","oneOf":[{{"title":"UNKNOWN","const":0}},{{"title":"UINT8","const":1}},{{"title":"INT8","const":2}},{{"title":"UINT16","const":3}},{{"title":"INT16","const":4}},{{"title":"UINT32","const":5}},{{"title":"INT32","const":6}},{{"title":"FLOAT32","const":7}},{{"title":"FLOAT64","const":8}}]}}}}}}}},"data":{{"type":"string","contentEncoding":"base64"}}"#
            ),
            Schema::Log => format!(
                r#"{TIME},"level":{{"title":"foxglove.LogLevel","oneOf":[{{"title":"UNKNOWN","const":0}},{{"title":"DEBUG","const":1}},{{"title":"INFO","const":2}},{{"title":"WARNING","const":3}},{{"title":"ERROR","const":4}},{{"title":"FATAL","const":5}}]}},"message":{{"type":"string"}},"name":{{"type":"string"}},"file":{{"type":"string"}},"line":{{"type":"integer","minimum":0}}"#
            ),
        };
        format!(
            r#"{{"title":"{}","type":"object","properties":{{{properties}}}}}"#,
            self.name()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_schema_is_json_and_names_itself() {
        for schema in [
            Schema::Step,
            Schema::Snapshot,
            Schema::Pose,
            Schema::Grid,
            Schema::Log,
        ] {
            let value: serde_json::Value = serde_json::from_str(&schema.text()).unwrap();
            assert_eq!(value["title"], schema.name());
            assert!(value["properties"].as_object().unwrap().len() >= 2);
        }
    }
}
