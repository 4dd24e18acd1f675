//! Libraries that are ONNX Runtime, and files that are not. A process loads one, so this is one test with a
//! process of its own.

use roomsight_vision::network::{Network, Runtime, RuntimeError};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A library of `source`, by the C compiler that building takes anyway.
fn library(folder: &Path, name: &str, source: &str) -> PathBuf {
    let (code, path) = (folder.join(format!("{name}.c")), folder.join(format!("{name}.so")));
    fs::write(&code, source).unwrap();
    let status = Command::new("cc").args(["-shared", "-fPIC", "-o"]).args([&path, &code]).status().unwrap();
    assert!(status.success());
    path
}

/// ONNX Runtime as far as it says which it is.
fn of_version(folder: &Path, version: &str) -> PathBuf {
    let source = format!(
        "static const void *api(unsigned version) {{ return 0; }}\n\
         static const char *version(void) {{ return \"{version}\"; }}\n\
         static const struct {{ const void *(*api)(unsigned); const char *(*version)(void); }} base = {{ api, version }};\n\
         const void *OrtGetApiBase(void) {{ return &base; }}\n"
    );
    library(folder, &format!("of-{version}"), &source)
}

#[test]
fn wrong_libraries_are_refused_with_what_to_do_and_the_right_one_is_loaded_once() {
    let folder = tempfile::tempdir().unwrap();
    let text = folder.path().join("text.so");
    fs::write(&text, "This is not a library.").unwrap();
    let refused = |path: &Path| {
        let said = Runtime::load(path).unwrap_err().to_string();
        assert!(said.contains("make networks") && !said.contains('\n'), "{said}");
        said
    };
    let said = Runtime::find(folder.path()).unwrap_err().to_string();
    assert!(said.starts_with("there is no ONNX Runtime in ") && said.contains("make networks"), "{said}");
    assert!(refused(&folder.path().join("none.so")).starts_with("there is no ONNX Runtime at "));
    assert!(refused(folder.path()).contains("is not the library of ONNX Runtime"));
    assert!(refused(&text).contains("is not the library of ONNX Runtime"));
    let other = library(folder.path(), "other", "int answer(void) { return 42; }");
    assert!(refused(&other).contains("it lacks OrtGetApiBase"));
    let nothing = library(folder.path(), "nothing", "void *OrtGetApiBase(void) { return 0; }");
    assert!(refused(&nothing).contains("it offers no interface"));
    let said = refused(&of_version(folder.path(), "1.16.3"));
    assert!(said.contains("is ONNX Runtime 1.16.3; 1.17 or newer is needed"), "{said}");

    let networks = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../networks");
    let library = match Runtime::find(&networks) {
        Ok(library) => library,
        Err(error @ RuntimeError::NoneInFolder(_)) => {
            return eprintln!("LEFT OUT: loading ONNX Runtime and the networks. {error}.");
        }
        Err(error) => panic!("{error}"),
    };
    let runtime = Runtime::load(&library).unwrap();
    Runtime::load(&text).expect("the process keeps to the one that is loaded");
    for (name, has_vector, n_grids) in [("efficientnet-lite0", true, 3), ("xfeat", false, 0)] {
        let network = Network::open(&networks.join(format!("{name}.onnx"))).unwrap();
        let size = network.description().input.size;
        let mut session = network.tried(&runtime, size).unwrap();
        let input = vec![0.5; 3 * (size.width * size.height) as usize];
        let outputs = session.run(&input).unwrap();
        assert_eq!(outputs.vector().is_some(), has_vector, "{name}");
        assert_eq!(network.description().grids.len(), n_grids, "{name}");
        for grid in network.description().grids.keys() {
            assert_eq!(outputs.grid(grid).unwrap().rows.n_cols(), session.grid_len(grid).unwrap(), "{name}");
        }
        assert_eq!(outputs.xfeat().is_some(), !has_vector, "{name}");
    }
}
