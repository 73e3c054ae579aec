// SPDX-License-Identifier: Apache-2.0
// What the C functions that plugins call have in common: whose call it is, and what becomes of mistakes.
#pragma once

#include "graph/execute_state.hpp"

namespace heddle::graph {

inline PassState& state_of(const heddle_pass_host* self) {
  return *static_cast<PassState*>(self->host);
}
inline Executor::State& executor_of(const PassState& pass) {
  return *static_cast<Executor::State*>(pass.executor_state);
}

/// Tells it with the pass; errors are kept for the end of the call that the plugin is in.
void say(const PassState& pass, Severity severity, std::string message, std::string help = {});
/// A mistake of the technique: HEDDLE_BUG after an error.
heddle_status wrong(const PassState& pass, std::string message);
/// True where a cached stage may ask for it, and of what is no such stage. Else told as a mistake: what was kept could
/// be stale.
bool is_in_key(const PassState& pass, bool is_declared, std::string_view what);

/// Runs `body`; an exception becomes a reported error and its status, so that nothing throws across the border.
template <class Body>
heddle_status guarded(PassState& pass, Body body) {
  try {
    return body();
  } catch (const Error& error) {
    for (const Diagnostic& diagnostic : error.diagnostics()) executor_of(pass).errors.push_back(diagnostic);
    return error.status();
  } catch (const std::exception& error) {
    say(pass, Severity::kError, error.what());
    return HEDDLE_FAILED;
  }
}

/// The shader of this stage and kind, or nullptr after a report.
ShaderState* find_shader(PassState& pass, const heddle_frame* frame, const char* name, ShaderKind kind);
void set_viewport(const heddle_vulkan& vk, VkCommandBuffer commands, std::uint32_t x, std::uint32_t y,
                  std::uint32_t width, std::uint32_t height);

// execute_services.cpp: heddle_pass_host.service.
const void* service(const heddle_pass_host* self, const char* id);

// execute_views.cpp: heddle_pass_host.draw, and the services of views and counters, nullptr for another id.
heddle_status draw_unplaced(const heddle_pass_host* self, heddle_frame* frame, const heddle_draw* given);
const void* views_service(std::string_view id);

// execute_contents.cpp: the service of contents, nullptr for another id.
const void* contents_service(std::string_view id);

// execute_pieces.cpp: the service of pieces, nullptr for another id.
const void* pieces_service(std::string_view id);

// execute_files.cpp: the services of images and stores, nullptr for another id.
const void* files_service(std::string_view id);

// execute_slices.cpp: the service of slices, nullptr for another id.
const void* slices_service(std::string_view id);

}  // namespace heddle::graph
