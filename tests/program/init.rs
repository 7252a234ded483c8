//! `init`: starting configurations of every carried plant, complete where they are written.

#![allow(clippy::unwrap_used, reason = "a test stops at what it did not expect")]

use std::fs;
use std::path::Path;

use reachcast::config::{Config, Overrides};

use crate::command::{Folder, document, done, refused};

/// The plants of `configs/models`, by the name of their model with the text of the file.
fn carried() -> Vec<(String, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/models");
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let texts = files.filter(|path| path.extension().is_some_and(|end| end == "toml"));
    let named = |path: std::path::PathBuf| {
        let text = fs::read_to_string(path).unwrap();
        let table: toml::Table = toml::from_str(&text).unwrap();
        (table["model"]["name"].as_str().unwrap().to_owned(), text)
    };
    texts.map(named).collect()
}

#[test]
fn every_carried_plant_is_one_to_start_from() {
    let help = done(&["init", "--help"]);
    for (name, text) in carried() {
        let folder = Folder::new();
        let file = folder.path("mine.toml");
        let written = document(&["init", &file, "--from", &name]);
        assert_eq!(written["from"], name.as_str());
        assert!(help.contains(&name), "no `{name}` in: {help}");
        // Nothing that it names lies elsewhere: it is read, with its networks, where it is.
        let config = Config::load(file.as_ref(), &Overrides::default()).unwrap();
        let policy = config.policy_source(Path::new(&folder.path(""))).unwrap();
        let plant = config.plant(&policy).unwrap();
        assert_eq!(plant.model.name, name);
        for named in config.planned_files(Path::new(&folder.path(""))).unwrap() {
            assert!(named.is_file(), "{} is not there", named.display());
        }
        let lines = fs::read_to_string(&file).unwrap();
        assert!(lines.starts_with("# A starting configuration"), "{lines}");
        let sections = |text: &str| text.lines().filter(|line| line.starts_with('[')).count();
        assert_eq!(sections(&lines), sections(&text), "sections are left as they are");
    }
}

#[test]
fn what_is_explained_is_not_there_already() {
    let folder = Folder::new();
    let file = folder.path("mine.toml");
    done(&["init", &file]);
    let text = fs::read_to_string(&file).unwrap();
    assert!(text.contains("\n[rollout]") && !text.contains("# [rollout]"), "{text}");
    assert!(text.contains("# [train]"), "{text}");
}

#[test]
fn what_is_there_stays() {
    let folder = Folder::new();
    let file = folder.path("mine.toml");
    fs::write(&file, "mine").unwrap();
    refused(&["init", &file], &["it is there already", "--overwrite"]);
    assert_eq!(fs::read_to_string(&file).unwrap(), "mine");
    done(&["init", &file, "--from", "dubins", "--overwrite"]);
    done(&["init", &file, "--from", "dubins"]);
    refused(&["init", &folder.path("mine.txt")], &["no name of a .toml file"]);
    refused(&["init", &file, "--from", "cartpole"], &["the nearest is `cart-pole`", "dubins"]);
}
