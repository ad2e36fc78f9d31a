//! What moves is where the truth has it, and layouts name what there is.

use model_offline::scene::Scene;
use serde_json::{Value, json};

use super::*;
use crate::world::truth::Truth;

fn stage() -> Stage {
    Stage::new(&Scene::bundled("paper").unwrap(), 3)
}

/// The needle's arrow ends where the needle is, and points along it; the paddle is where it was moved to.
#[test]
fn what_moves_is_where_the_truth_has_it() {
    let stage = stage();
    let truth = Truth {
        time_ns: 3_000_000_007,
        depth: 0.05,
        target: [0.01, -0.02, 0.0],
        paddles: [[0.0, -0.03, 0.0], [0.0; 3]],
        ..Truth::default()
    };
    let update = serde_json::to_value(stage.at_tick(&truth)).unwrap();
    let entity = |id: &str| {
        let entities = update["entities"].as_array().unwrap();
        entities.iter().find(|entity| entity["id"] == id).unwrap().clone()
    };
    assert_eq!(entity("needle")["timestamp"], json!({"sec": 3, "nsec": 7}));
    let arrow = entity("needle")["arrows"][0].clone();
    let number = |value: &Value| value.as_f64().unwrap();
    let [z, w] = ["z", "w"].map(|name| number(&arrow["pose"]["orientation"][name]));
    // A rotation by 2·atan2(z, w) about the axis out of the plane.
    let axis = [1.0 - 2.0 * z * z, 2.0 * z * w];
    let length = number(&arrow["shaft_length"]) + number(&arrow["head_length"]);
    let entry = model_offline::output::surface::middle(&stage.geometry.needle_contact);
    for (k, name) in ["x", "y"].into_iter().enumerate() {
        assert!((axis[k] - stage.geometry.needle_axis[k]).abs() < 1e-12);
        let tip = number(&arrow["pose"]["position"][name]) + length * axis[k];
        assert!((tip - entry[k] - 0.05 * stage.geometry.needle_axis[k]).abs() < 1e-12, "{name}: {tip}");
    }
    let paddle = &stage.geometry.paddles[2];
    assert_eq!(number(&entity("paddle")["lines"][0]["points"][0]["y"]), paddle.segment[0][1] - 0.03);
    assert_eq!(number(&entity("target")["spheres"][0]["pose"]["position"]["x"]), stage.geometry.target[0] + 0.01);
}

/// Every panel of the layout has its settings, and every topic that it names is written.
#[test]
fn the_layout_names_what_there_is() {
    let layout = stage().layout();
    let panels = layout["configById"].as_object().unwrap();
    let text = layout["layout"].to_string();
    assert!(panels.len() == 4 && panels.keys().all(|panel| text.contains(panel.as_str())), "{text}");
    let topics = super::super::messages::schemas().map(|(topic, ..)| topic);
    let paths = panels.values().flat_map(|panel| panel["paths"].as_array().into_iter().flatten());
    for path in paths {
        let topic = path["value"].as_str().unwrap().split('.').next().unwrap();
        assert!(topics.contains(&topic), "{topic}");
    }
    assert!(topics.contains(&"/scene"));
}
