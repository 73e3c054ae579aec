// SPDX-License-Identifier: Apache-2.0
// A scene overlay (*.scene.toml): a file to load, and what is different in it: lights, materials, cameras.
#pragma once

#include "scene/scene.hpp"

namespace heddle::scene {

/// Applies the overlay, all or nothing. All its mistakes are reported together, each with its place. A `file` in it is
/// loaded first (glTF, or another overlay), and the overlay then changes that file's part of the scene alone; without
/// one it changes the whole scene.
void load_overlay(Scene& scene, const std::filesystem::path& file, const LoadLimits& limits = {});

}  // namespace heddle::scene
