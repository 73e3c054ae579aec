// SPDX-License-Identifier: Apache-2.0
// heddle run --watch: renders again when a file changes that the picture was made of.
#pragma once

#include "cli/session.hpp"

#include <functional>

namespace heddle::cli {

/// Calls `render`; then, until it is stopped, waits for a change of a file that graph or scene were read from, reads
/// again what it touches, and renders again. What fails is said, and the last good picture stays. `scene` is replaced
/// when its files change.
[[noreturn]] void watch(heddle_host* host, heddle_graph* graph, Owned<heddle_scene>& scene,
                        const RenderArguments& arguments, const std::function<void()>& render);

}  // namespace heddle::cli
