// SPDX-License-Identifier: Apache-2.0
// What the C functions that plugins call have in common.
#include "graph/execute_calls.hpp"

#include <fmt/format.h>

namespace heddle::graph {

void say(const PassState& pass, Severity severity, std::string message, std::string help) {
  Executor::State& executor = executor_of(pass);
  const Pass& declared = executor.pass_of(pass);
  Diagnostic diagnostic;
  diagnostic.severity = severity;
  diagnostic.where = declared.where;
  diagnostic.message =
      fmt::format("pass '{}' ({}): {}", declared.name, declared.entry.technique->id, std::move(message));
  diagnostic.help = std::move(help);
  if (severity == Severity::kError) {
    executor.errors.push_back(std::move(diagnostic));
  } else {
    executor.services.log(severity, to_text(diagnostic));
  }
}

heddle_status wrong(const PassState& pass, std::string message) {
  say(pass, Severity::kError, std::move(message), "this is a mistake of the technique, not of the graph");
  return HEDDLE_BUG;
}

bool is_in_key(const PassState& pass, bool is_declared, std::string_view what) {
  if (pass.cached_stage == nullptr || is_declared) return true;
  wrong(pass, fmt::format("stage '{}' is cached and asks for {}, which its key does not hold", pass.cached_stage->name,
                          what));
  return false;
}

ShaderState* find_shader(PassState& pass, const heddle_frame* frame, const char* name, ShaderKind kind) {
  const auto found = pass.shaders.find(std::string_view(name));
  if (found == pass.shaders.end() || found->second.shader->kind != kind || found->second.stage != frame->stage->stage) {
    wrong(pass, fmt::format("stage '{}' has no shader '{}' of this kind",
                            executor_of(pass).technique_of(pass).stages[frame->stage->stage].name, name));
    return nullptr;
  }
  if (frame->commands == VK_NULL_HANDLE) {
    wrong(pass, fmt::format("records shader '{}' outside of record", name));
    return nullptr;
  }
  return &found->second;
}

void set_viewport(const heddle_vulkan& vk, VkCommandBuffer commands, std::uint32_t x, std::uint32_t y,
                  std::uint32_t width, std::uint32_t height) {
  const VkViewport viewport{
      static_cast<float>(x), static_cast<float>(y), static_cast<float>(width), static_cast<float>(height), 0.0F, 1.0F};
  const VkRect2D scissor{{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)}, {width, height}};
  vk.CmdSetViewport(commands, 0, 1, &viewport);
  vk.CmdSetScissor(commands, 0, 1, &scissor);
}

}  // namespace heddle::graph
