// SPDX-License-Identifier: Apache-2.0
// Scripts: a command takes several frames of the window, in each of which mouse and keys are where the script has them.
#include "diagnostics.hpp"
#include "view/window.hpp"

#include <fmt/format.h>

#include <cstdio>

namespace heddle::view {

namespace {

using Kind = ScriptLine::Kind;

struct NamedKey {
  const char* name;
  int key;
};
constexpr std::array<NamedKey, 14> kKeys{{{"Space", GLFW_KEY_SPACE},
                                          {"Tab", GLFW_KEY_TAB},
                                          {"Home", GLFW_KEY_HOME},
                                          {"PageUp", GLFW_KEY_PAGE_UP},
                                          {"PageDown", GLFW_KEY_PAGE_DOWN},
                                          {"Escape", GLFW_KEY_ESCAPE},
                                          {"Enter", GLFW_KEY_ENTER},
                                          {"Left", GLFW_KEY_LEFT},
                                          {"Right", GLFW_KEY_RIGHT},
                                          {"Up", GLFW_KEY_UP},
                                          {"Down", GLFW_KEY_DOWN},
                                          {"Shift", GLFW_KEY_LEFT_SHIFT},
                                          {"Period", GLFW_KEY_PERIOD},
                                          {"Comma", GLFW_KEY_COMMA}}};

/// GLFW's number of a letter, a digit or a named key; 0: none.
int key_of(const std::string& name) {
  for (const NamedKey& known : kKeys)
    if (name == known.name) return known.key;
  const char c = name.size() == 1 ? name[0] : '\0';
  if (c >= 'a' && c <= 'z') return GLFW_KEY_A + (c - 'a');
  if ((c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9')) return c;
  return 0;
}

constexpr int kSearchFrames = 20;  // a popup opens, a tab draws, a list scrolls
constexpr double kFramesASecond = 60;

ImVec2 middle(const Widget& widget) {
  return {0.5F * (widget.low.x + widget.high.x), 0.5F * (widget.low.y + widget.high.y)};
}

}  // namespace

void Window::mark(const std::string& name) {
  mark(name, ImGui::GetItemRectMin(), ImGui::GetItemRectMax());
  widgets_[name].is_visible = ImGui::IsItemVisible();
  if (scroll_to_ == name) ImGui::SetScrollHereY();
}

void Window::mark(const std::string& name, ImVec2 low, ImVec2 high) {
  widgets_[name] = {low, high, {}, false, true};
}

void Window::mark_grab(const std::string& name, ImVec2 grab) {
  widgets_[name].grab = grab;
  widgets_[name].has_grab = true;
}

void Window::fail_script(const std::string& message, const std::string& found, const std::string& expected) const {
  const int line = player_->lines_[player_->next_].line;
  std::vector<std::string> names;
  for (const auto& [name, widget] : widgets_) names.push_back(name);
  const std::string near = nearest_name(found, names);
  throw Error(HEDDLE_BAD_INPUT,
              Diagnostic{Severity::kError,
                         {player_->file(), static_cast<std::uint32_t>(line), 1},
                         message,
                         found,
                         expected,
                         near.empty() || near == found ? "" : fmt::format("did you mean '{}'?", near)});
}

/// Before a frame: what the script does in it.
void Window::play_script() {
  if (!scripted()) return;
  Player& p = *player_;
  const int frames_due = frames_to_draw_;
  const auto go = [&](int phase) {
    p.phase_ = phase;
    p.frames_ = 0;
  };
  const auto done = [&] {
    ++p.next_;
    go(0);
    scroll_to_.clear();
  };
  // Where a named widget is, once it is in sight.
  const auto find = [&](const std::string& name) -> const Widget* {
    const auto found = widgets_.find(name);
    if (found != widgets_.end() && found->second.is_visible && p.frames_ > 1) return &found->second;
    scroll_to_ = name;
    if (++p.frames_ > kSearchFrames) {
      fail_script("the window shows no widget of that name", name,
                  "a name that the command 'state' prints; open its tab or its pass with 'click' first");
    }
    return nullptr;
  };
  for (bool is_next = true; is_next && !p.is_done();) {
    is_next = false;
    const ScriptLine& line = p.lines_[p.next_];
    frames_to_draw_ = std::max(frames_to_draw_, 1);
    switch (line.kind) {
      case Kind::kWait:
        // Orders of this very frame are given while it is drawn.
        if (p.phase_ == 0) {
          if (++p.frames_ > 2) go(1);
        } else if (report_.orders_done >= last_order_ && report_.is_settled) {
          if (++p.frames_ > 2) done();
        } else {
          frames_to_draw_ = 0;  // the session wakes the window
        }
        break;
      case Kind::kPause:
        if (p.phase_ == 0) {
          p.until_ = glfwGetTime() + line.numbers[0];
          go(1);
        }
        frames_to_draw_ = frames_due;  // as without a script
        if (glfwGetTime() >= p.until_) done();
        break;
      case Kind::kClick:
      case Kind::kSlide:
      case Kind::kType:
        if (p.phase_ == 0) {
          const Widget* widget = find(line.name);
          if (widget == nullptr) break;
          p.from_ = p.to_ = middle(*widget);
          if (line.kind == Kind::kSlide) {
            // The grab of a slider has half its width to both sides of the track.
            const float pad = widget->has_grab ? 0.0F : 2.0F + 0.5F * ImGui::GetStyle().GrabMinSize;
            p.to_.x =
                widget->low.x + pad + static_cast<float>(line.numbers[0]) * (widget->high.x - widget->low.x - 2 * pad);
            p.from_ = widget->has_grab ? widget->grab : p.to_;
            if (widget->has_grab) p.to_.y = p.from_.y;
          }
          p.mouse_ = p.from_;
          go(1);
        } else if (p.phase_ == 1) {  // over it
          if (++p.frames_ > 1) go(2);
        } else if (p.phase_ == 2) {  // pressed
          p.is_down_ = true;
          if (++p.frames_ > 1) go(3);
        } else if (p.phase_ == 3) {  // moved
          p.mouse_ = p.to_;
          if (++p.frames_ > 2) go(4);
        } else if (p.phase_ == 4) {  // let go
          p.is_down_ = false;
          if (++p.frames_ > 2) line.kind == Kind::kType ? go(5) : done();
        } else if (p.phase_ == 5) {  // the field selects all when it is entered
          p.typed_ = line.text;
          go(6);
        } else if (p.phase_ == 6) {
          p.key_ = p.frames_ == 0 ? 0 : GLFW_KEY_ENTER;
          if (++p.frames_ > 3) {
            p.key_ = 0;
            go(7);
          }
        } else if (++p.frames_ > 2) {
          done();
        }
        break;
      case Kind::kDrag:
        if (p.phase_ == 0) {
          const float scale = (picture_high_.x - picture_low_.x) /
                              static_cast<float>(report_.variants[0].picture ? report_.variants[0].picture->width : 1);
          const auto at = [&](std::size_t i) {
            return ImVec2{picture_low_.x + (static_cast<float>(line.numbers[i]) + 0.5F) * scale,
                          picture_low_.y + (static_cast<float>(line.numbers[i + 1]) + 0.5F) * scale};
          };
          p.mouse_ = p.from_ = at(0);
          p.to_ = at(2);
          if (++p.frames_ > 2) go(1);
        } else if (p.phase_ == 1) {
          p.is_down_ = true;
          if (++p.frames_ > 1) go(2);
        } else if (p.phase_ == 2) {
          p.mouse_ = p.to_;
          if (++p.frames_ > 2) go(3);
        } else {
          p.is_down_ = false;
          if (++p.frames_ > 2) done();
        }
        break;
      case Kind::kKey: {
        p.key_ = key_of(line.name);
        if (p.key_ == 0) {
          std::string names = "a letter, a digit";
          for (const NamedKey& known : kKeys) names += fmt::format(", {}", known.name);
          fail_script("there is no key of that name", line.name, names);
        }
        const double seconds = line.numbers.empty() ? 0 : line.numbers[0];
        if (++p.frames_ > std::max(1, static_cast<int>(std::lround(seconds * kFramesASecond)))) {
          p.key_ = 0;
          if (p.frames_ > static_cast<int>(std::lround(seconds * kFramesASecond)) + 3) done();
        }
        break;
      }
      case Kind::kScreenshot:
        if (p.phase_ == 0) {
          shot_file_ = line.name;
          go(1);
        } else if (report_.orders_done >= last_order_) {
          if (const std::string& refused = report_.variants[0].refused; !refused.empty()) {
            throw Error(HEDDLE_FAILED, Diagnostic{Severity::kError,
                                                  {p.file(), static_cast<std::uint32_t>(line.line), 1},
                                                  "the screenshot was not written",
                                                  refused,
                                                  "a file '" + line.name + "'",
                                                  ""});
          }
          done();
        } else {
          frames_to_draw_ = 0;
        }
        break;
      case Kind::kState:
        tell_state();
        done();
        is_next = true;
        break;
      case Kind::kQuit:
        glfwSetWindowShouldClose(window_, GLFW_TRUE);
        done();
        break;
    }
  }
}

/// In place of the mouse and the keyboard that there are.
void Window::put_script_input() {
  if (!scripted()) return;
  ImGuiIO& io = ImGui::GetIO();
  io.MousePos = player_->mouse_;
  std::fill(std::begin(io.MouseDown), std::end(io.MouseDown), false);
  io.MouseDown[0] = player_->is_down_;
  std::fill(std::begin(io.KeysDown), std::end(io.KeysDown), false);
  io.KeyShift = io.KeyCtrl = io.KeyAlt = false;
  if (player_->key_ != 0) io.KeysDown[player_->key_] = true;
  for (const char c : std::exchange(player_->typed_, {})) io.AddInputCharacter(static_cast<unsigned char>(c));
  io.DeltaTime = static_cast<float>(1 / kFramesASecond);
}

void Window::tell_state() {
  Json json{{"frames", report_.frames},
            {"submits", report_.submits},
            {"warnings", report_.warnings},
            {"draws", draws_},
            {"read_bytes", report_.read_bytes},
            {"read_ms", report_.read_ms},
            {"device", report_.device},
            {"drawn_by", drawn_by_},
            {"settled", report_.is_settled},
            {"time", report_.time},
            {"mode", static_cast<int>(mode_)},
            {"picture", {picture_low_.x, picture_low_.y, picture_high_.x, picture_high_.y}},
            {"camera", {{"position", report_.camera.position}, {"rotation", report_.camera.rotation}}}};
  json["variants"] = Json::array();
  for (const VariantReport& variant : report_.variants) {
    if (!variant.is_there) continue;
    Json one{{"error", variant.error},
             {"refused", variant.refused},
             {"pictures", variant.picture ? variant.picture->serial : 0},
             {"parameters", Json::object()}};
    for (const Json& pass : variant.description.at("passes")) {
      one["parameters"][pass.at("name").get<std::string>() + ".technique"] = pass.at("technique");
      const Json parameters = pass.value("parameters", Json::object());
      for (const auto& [name, value] : parameters.items())
        one["parameters"][pass.at("name").get<std::string>() + ".params." + name] = value;
    }
    one["costs"] = Json::object();
    for (const auto& [key, costs] : variant.costs) {
      one["costs"][key] = Json::array();
      for (const Cost& cost : costs.steps)
        one["costs"][key].push_back({{"value", cost.value},
                                     {"median_ms", cost.ms.value},
                                     {"low_ms", cost.ms.low},
                                     {"high_ms", cost.ms.high},
                                     {"shown", cost.error.empty() ? cost_text(cost) : cost.error}});
    }
    json["variants"].push_back(std::move(one));
  }
  json["widgets"] = Json::object();
  for (const auto& [name, widget] : widgets_)
    if (widget.is_visible) json["widgets"][name] = {widget.low.x, widget.low.y, widget.high.x, widget.high.y};
  fmt::print("{}\n", write_json(json));
  std::fflush(stdout);
}

}  // namespace heddle::view
