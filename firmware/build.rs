//! Tells the linker where the image's memory map is. Does nothing for host builds.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=image/memory.x");
    println!("cargo:rerun-if-changed=image/device.x");
    let is_set = |name: &str| std::env::var_os(name).is_some();
    let bare_metal = std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "none");
    if is_set("CARGO_FEATURE_IMAGE") && bare_metal {
        println!("cargo:rustc-link-search={}/image", env!("CARGO_MANIFEST_DIR"));
        println!("cargo:rustc-link-arg-bins=-Tlink.x");
        // cortex-m-rt asks for it where code starts at address 0.
        println!("cargo:rustc-link-arg-bins=--nmagic");
    }
}
