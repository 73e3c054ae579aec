// SPDX-License-Identifier: Apache-2.0
// A JSON Schema (draft 7) of scene overlays, *.scene.toml, for editors.
#pragma once

#include "json.hpp"
#include "plugin/component.hpp"

namespace heddle::scene {

/// The keys and ranges of overlay.cpp, and the components that roles declare; a test compares both.
Json overlay_schema(const ComponentCatalog& catalog);

}  // namespace heddle::scene
