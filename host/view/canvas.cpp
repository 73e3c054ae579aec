// SPDX-License-Identifier: Apache-2.0
// The picture: A and B with the wipe between them, and the mouse and the keys that look around in it.
#include "view/fly.hpp"
#include "view/picture.hpp"
#include "view/window.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace heddle::view {

namespace {

constexpr float kNearWipe = 8;  // pixels of the screen
constexpr ImU32 kWipeColor = IM_COL32(255, 255, 255, 255);
constexpr ImU32 kErrorBack = IM_COL32(90, 16, 16, 235);
constexpr ImU32 kErrorText = IM_COL32(255, 225, 215, 255);
constexpr ImU32 kWarningBack = IM_COL32(82, 62, 10, 235);
constexpr ImU32 kWarningText = IM_COL32(255, 240, 205, 255);
constexpr double kOrthographicTurn = 0.005;  // radians a pixel: no angle of view says more

ImTextureID texture_id(unsigned id) {
  return reinterpret_cast<ImTextureID>(static_cast<std::uintptr_t>(id));
}

}  // namespace

void Window::canvas(ImVec2 low, ImVec2 high) {
  ImGui::SetNextWindowPos(low);
  ImGui::SetNextWindowSize({high.x - low.x, high.y - low.y});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {0, 0});
  ImGui::Begin("picture", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoBringToFrontOnFocus |
                   ImGuiWindowFlags_NoScrollWithMouse | ImGuiWindowFlags_NoBackground);
  ImGui::PopStyleVar();
  draw_pictures(low, high);
  mouse_in_picture(low, high);
  notices(low, high);
  ImGui::End();
}

void Window::draw_pictures(ImVec2 low, ImVec2 high) {
  const auto& a = report_.variants[0].picture;
  const auto& b = report_.variants[1].picture;
  ImDrawList* list = ImGui::GetWindowDrawList();
  if (!a) {
    const std::string text = !report_.activity.empty() ? report_.activity
                             : report_.is_settled      ? "there is no picture"
                                                       : "rendering the first frame ...";
    list->AddText({low.x + 20, low.y + 20}, IM_COL32(200, 200, 200, 255), text.c_str());
    return;
  }
  const auto width = static_cast<float>(a->width), height = static_cast<float>(a->height);
  const float fit = std::min({1.0F, (high.x - low.x) / width, (high.y - low.y) / height});
  const float scale = zoom_ > 0 ? zoom_ : fit;
  const ImVec2 size{width * scale, height * scale};
  // On whole pixels, so that at 1:1 the screen has the picture's own bytes.
  picture_low_ = {std::floor(low.x + 0.5F * (high.x - low.x - size.x) + pan_.x),
                  std::floor(low.y + 0.5F * (high.y - low.y - size.y) + pan_.y)};
  picture_high_ = {picture_low_.x + size.x, picture_low_.y + size.y};
  const auto part = [&](const Texture& texture, float from, float to) {
    if (texture.id == 0 || from >= to) return;
    list->AddImage(texture_id(texture.id), {picture_low_.x + from * size.x, picture_low_.y},
                   {picture_low_.x + to * size.x, picture_high_.y}, {from, 0}, {to, 1});
  };
  mark("picture", picture_low_, picture_high_);
  const Mode mode = b ? mode_ : Mode::kA;
  if (mode == Mode::kWipe) {
    // On a whole pixel of the picture: each column is A's or B's.
    const float at = std::round(wipe_ * width) / width;
    part(textures_[0], 0, at);
    part(textures_[1], at, 1);
    const float x = picture_low_.x + at * size.x;
    const float middle = 0.5F * (std::max(picture_low_.y, low.y) + std::min(picture_high_.y, high.y));
    list->AddRectFilled({x - 1, picture_low_.y}, {x + 1, picture_high_.y}, kWipeColor);
    list->AddCircleFilled({x, middle}, 7, kWipeColor);
    list->AddCircle({x, middle}, 7, IM_COL32(0, 0, 0, 255));
    mark("wipe", picture_low_, picture_high_);
    mark_grab("wipe", {x, middle});
  } else if (mode == Mode::kDifference) {
    part(difference_, 0, 1);
  } else {
    part(textures_[mode == Mode::kB ? 1 : 0], 0, 1);
  }
  if (b) {
    const auto label = [&](const char* text, float x) {
      const ImVec2 at{std::max(x, low.x + 6), std::max(picture_low_.y, low.y) + 6};
      list->AddRectFilled({at.x - 3, at.y - 2}, {at.x + ImGui::CalcTextSize(text).x + 3, at.y + 15},
                          IM_COL32(0, 0, 0, 150));
      list->AddText(at, IM_COL32(255, 255, 255, 255), text);
    };
    if (mode == Mode::kA || mode == Mode::kWipe) label("A", picture_low_.x + 6);
    if (mode == Mode::kWipe) label("B", std::min(picture_high_.x, high.x) - 14);
    if (mode == Mode::kB) label("B", picture_low_.x + 6);
    if (mode == Mode::kDifference) label(fmt::format("|A - B| x {:.0f}", gain_).c_str(), picture_low_.x + 6);
  }
}

ImVec2 Window::pixel_at(ImVec2 mouse) const {
  const auto& a = report_.variants[0].picture;
  if (!a || picture_high_.x <= picture_low_.x) return {-1, -1};
  const float scale = (picture_high_.x - picture_low_.x) / static_cast<float>(a->width);
  const ImVec2 pixel{std::floor((mouse.x - picture_low_.x) / scale), std::floor((mouse.y - picture_low_.y) / scale)};
  const bool is_inside =
      pixel.x >= 0 && pixel.y >= 0 && pixel.x < static_cast<float>(a->width) && pixel.y < static_cast<float>(a->height);
  return is_inside ? pixel : ImVec2{-1, -1};
}

void Window::take_camera() {
  if (report_.orders_done >= camera_order_ && report_.camera.struct_size != 0) camera_ = report_.camera;
}

void Window::send_camera() {
  // From one camera on, all frames show the same; a name that is renewed replaces what waits.
  camera_order_ = last_order_ = session_.order("camera", [camera = camera_](Session& session) { session.fly(camera); });
  scene_camera_ = -1;
}

void Window::level_camera() {
  take_camera();
  level(camera_);
  send_camera();
}

/// It is followed, if an animation moves it, until somebody flies.
void Window::use_scene_camera(int id) {
  scene_camera_ = id;
  camera_order_ = last_order_ =
      session_.order("camera", [id](Session& session) { session.use_camera(static_cast<std::uint32_t>(id)); });
}

void Window::mouse_in_picture(ImVec2 canvas_low, ImVec2 canvas_high) {
  ImGuiIO& io = ImGui::GetIO();
  ImGui::SetCursorScreenPos(canvas_low);
  ImGui::InvisibleButton(
      "canvas", {canvas_high.x - canvas_low.x, canvas_high.y - canvas_low.y},
      ImGuiButtonFlags_MouseButtonLeft | ImGuiButtonFlags_MouseButtonRight | ImGuiButtonFlags_MouseButtonMiddle);
  is_hovered_ = ImGui::IsItemHovered();
  const auto& a = report_.variants[0].picture;
  if (!a) return;
  const float width = picture_high_.x - picture_low_.x;
  const float wipe_x = picture_low_.x + wipe_ * width;
  const bool is_near_wipe =
      report_.variants[1].picture && mode_ == Mode::kWipe && std::abs(io.MousePos.x - wipe_x) <= kNearWipe;
  if (is_hovered_ && is_near_wipe && drag_ == Drag::kNone) ImGui::SetMouseCursor(ImGuiMouseCursor_ResizeEW);
  if (ImGui::IsItemActivated()) {
    ImGui::SetWindowFocus();
    drag_ = io.MouseDown[2] ? Drag::kPan : io.MouseDown[0] && is_near_wipe ? Drag::kWipe : Drag::kLook;
    take_camera();
  }
  if (ImGui::IsItemActive()) {
    const bool has_moved = io.MouseDelta.x != 0 || io.MouseDelta.y != 0;
    if (drag_ == Drag::kWipe && width > 0) {
      wipe_ = std::clamp((io.MousePos.x - picture_low_.x) / width, 0.0F, 1.0F);
    } else if (drag_ == Drag::kPan) {
      pan_.x += io.MouseDelta.x;
      pan_.y += io.MouseDelta.y;
    } else if (drag_ == Drag::kLook && has_moved && camera_.struct_size != 0) {
      // What is under the mouse, near the middle, stays under it.
      const double turn = camera_.is_orthographic != 0 ? kOrthographicTurn
                                                       : 2 * std::tan(camera_.vertical_angle / 2) /
                                                             static_cast<double>(picture_high_.y - picture_low_.y);
      look(camera_, io.MouseDelta.x * turn, io.MouseDelta.y * turn);
      send_camera();
    }
  } else {
    drag_ = Drag::kNone;
  }
  if (is_hovered_ && io.MouseWheel != 0) {
    if (io.KeyCtrl) {
      const float scale = width / static_cast<float>(a->width);
      zoom_ = std::clamp(io.MouseWheel > 0 ? std::floor(scale) + 1 : std::ceil(scale) - 1, 0.0F, 32.0F);
      if (zoom_ <= 1) pan_ = {0, 0};
    } else {
      speed_ *= std::pow(1.25, io.MouseWheel);
    }
  }
}

bool Window::is_flying() const {
  if (ImGui::GetIO().WantTextInput) return false;
  for (const int key : {GLFW_KEY_W, GLFW_KEY_A, GLFW_KEY_S, GLFW_KEY_D, GLFW_KEY_Q, GLFW_KEY_E, GLFW_KEY_LEFT,
                        GLFW_KEY_RIGHT, GLFW_KEY_UP, GLFW_KEY_DOWN})
    if (ImGui::IsKeyDown(key)) return true;
  return false;
}

void Window::fly_by_keys() {
  if (!has_speed_ && report_.scene) {
    // A scene is crossed in some ten seconds.
    const Json& box = report_.scene->at("bounds");
    double squares = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      const double side = box[1][i].get<double>() - box[0][i].get<double>();
      squares += side * side;
    }
    speed_ = std::isfinite(squares) && squares > 0 ? std::sqrt(squares) / 10 : 1.0;
    has_speed_ = true;
  }
  if (drag_ == Drag::kNone && !is_flying()) take_camera();
  if (!is_flying() || camera_.struct_size == 0) return;
  const ImGuiIO& io = ImGui::GetIO();
  const double seconds = std::min(static_cast<double>(io.DeltaTime), 0.1);
  const double pace =
      speed_ * seconds * (ImGui::IsKeyDown(GLFW_KEY_LEFT_SHIFT) ? 4.0 : 1.0) * (io.KeyCtrl ? 0.25 : 1.0);
  const auto axis = [](int more, int less) {
    return (ImGui::IsKeyDown(more) ? 1.0 : 0.0) - (ImGui::IsKeyDown(less) ? 1.0 : 0.0);
  };
  move(camera_, pace * axis(GLFW_KEY_D, GLFW_KEY_A), pace * axis(GLFW_KEY_E, GLFW_KEY_Q),
       pace * axis(GLFW_KEY_W, GLFW_KEY_S));
  look(camera_, seconds * axis(GLFW_KEY_LEFT, GLFW_KEY_RIGHT), seconds * axis(GLFW_KEY_UP, GLFW_KEY_DOWN));
  send_camera();
}

/// What went wrong, and above it what was warned of, at the picture's lower end.
void Window::notices(ImVec2 low, ImVec2 high) {
  std::string wrong;
  bool has_picture = true;
  for (Variant v = 0; v < kVariants; ++v) {
    for (const std::string* message : {&report_.variants[v].error, &report_.variants[v].refused}) {
      if (message->empty()) continue;
      wrong += fmt::format("{}{}: {}", wrong.empty() ? "" : "\n", kVariantNames[v], *message);
      has_picture = has_picture && report_.variants[v].picture != nullptr;
    }
  }
  if (!wrong.empty() && has_picture) wrong += "\nThe picture is the last good one.";
  ImDrawList* list = ImGui::GetWindowDrawList();
  const float width = high.x - low.x - 40;
  float bottom = high.y - 20;
  const auto box = [&](const std::string& text, ImU32 back, ImU32 ink) {
    if (text.empty()) return;
    const ImVec2 size = ImGui::CalcTextSize(text.c_str(), nullptr, false, width);
    const ImVec2 at{low.x + 20, bottom - size.y};
    list->AddRectFilled({at.x - 8, at.y - 6}, {at.x + std::max(size.x, 100.0F) + 8, at.y + size.y + 6}, back, 4);
    list->AddText(nullptr, 0, at, ink, text.c_str(), nullptr, width);
    bottom = at.y - 18;
  };
  box(wrong, kErrorBack, kErrorText);
  box(report_.warnings, kWarningBack, kWarningText);
}

void Window::status_bar(ImVec2 low, ImVec2 high) {
  ImGui::SetNextWindowPos(low);
  ImGui::SetNextWindowSize({high.x - low.x, high.y - low.y});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, {6, 3});
  ImGui::Begin("status", nullptr, ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove);
  ImGui::PopStyleVar();
  if (ImGui::Button(report_.is_playing ? "pause" : "play")) {
    last_order_ = session_.order("play", [plays = !report_.is_playing](Session& session) { session.play(plays); });
  }
  mark("play");
  ImGui::SameLine();
  if (ImGui::Button("step")) last_order_ = session_.order("step", [](Session& session) { session.step(true); });
  mark("step");
  ImGui::SameLine();
  ImGui::Text("%.3f s", report_.time);
  if (report_.variants[1].is_there) {
    constexpr std::array<const char*, 4> kModes{"A##mode", "B##mode", "wipe", "difference"};
    constexpr std::array<const char*, 4> kNames{"mode/A", "mode/B", "mode/wipe", "mode/difference"};
    ImGui::SameLine(0, 24);
    for (std::size_t i = 0; i < kModes.size(); ++i) {
      if (ImGui::RadioButton(kModes[i], static_cast<std::size_t>(mode_) == i)) mode_ = static_cast<Mode>(i);
      mark(kNames[i]);
      ImGui::SameLine();
    }
    if (mode_ == Mode::kDifference) {
      ImGui::SetNextItemWidth(90);
      ImGui::SliderFloat("##gain", &gain_, 1, 64, "x %.0f", ImGuiSliderFlags_Logarithmic);
      mark("gain");
      ImGui::SameLine();
    }
  }
  ImGui::SameLine(0, 24);
  std::string text;
  for (Variant v = 0; v < kVariants; ++v) {
    const VariantReport& variant = report_.variants[v];
    if (!variant.picture) continue;
    text += fmt::format("{} {:.1f} ms", kVariantNames[v], variant.submit_ms);
    for (const Loop& loop : variant.loops) text += fmt::format(", {} {}/{}", loop.pass, loop.done, loop.total);
    text += "   ";
  }
  text += !report_.activity.empty() ? report_.activity : report_.is_settled ? "at rest" : "rendering";
  if (report_.variants[1].picture && mode_ == Mode::kDifference) text += "   " + difference_text_;
  const ImVec2 pixel = is_hovered_ ? pixel_at(ImGui::GetIO().MousePos) : ImVec2{-1, -1};
  if (pixel.x >= 0) {
    text += fmt::format("   ({:.0f}, {:.0f})", pixel.x, pixel.y);
    for (Variant v = 0; v < kVariants; ++v) {
      const auto& picture = report_.variants[v].picture;
      const auto x = static_cast<std::size_t>(pixel.x), y = static_cast<std::size_t>(pixel.y);
      if (!picture || x >= picture->width || y >= picture->height) continue;
      const std::uint8_t* bytes = &picture->rgba[4 * (y * picture->width + x)];
      text += fmt::format(" {} {} {} {}", kVariantNames[v], bytes[0], bytes[1], bytes[2]);
    }
  }
  ImGui::TextUnformatted(text.c_str());
  ImGui::End();
}

}  // namespace heddle::view
