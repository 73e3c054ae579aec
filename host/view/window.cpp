// SPDX-License-Identifier: Apache-2.0
// GLFW and OpenGL: the window, its textures and its loop; and the module's entry.
#include "view/window.hpp"

#include "diagnostics.hpp"
#include "view/picture.hpp"

#include <GL/gl.h>
#include <fmt/format.h>
#include <imgui/backends/imgui_impl_glfw.h>
#include <imgui/backends/imgui_impl_opengl3.h>

#include <unistd.h>
#include <algorithm>
#include <cstring>

namespace heddle::view {

namespace {

constexpr float kPanelWidth = 500, kStatusHeight = 26;
constexpr std::array<int, 2> kLeastPicture{480, 520};  // with room for the panel's passes beside it
// After an event: hovering, popups and scrolling need some frames until nothing changes any more.
constexpr int kFramesAfterEvent = 3;
// While keys fly: as screens do it, also where no screen holds the loop back.
constexpr double kFlyingPause = 1.0 / 60;
constexpr unsigned kClampToEdge = 0x812F;  // GL_CLAMP_TO_EDGE, of OpenGL 1.2

std::string& glfw_error() {
  static std::string text;
  return text;
}

void note_event(GLFWwindow* window) {
  *static_cast<int*>(glfwGetWindowUserPointer(window)) = kFramesAfterEvent;
}

}  // namespace

Window::Window(const heddle_view_application& application)
    : application_(application), session_(application, [] { glfwPostEmptyEvent(); }) {
  if (application.script != nullptr)
    player_ = std::make_unique<Player>(read_script(application.script), application.script);
  if (application.graphs[1] != nullptr) mode_ = Mode::kWipe;
  glfwSetErrorCallback([](int, const char* text) { glfw_error() = text; });
  if (glfwInit() != GLFW_TRUE) {
    throw Error(HEDDLE_UNSUPPORTED,
                Diagnostic{Severity::kError,
                           {},
                           "no window can be opened",
                           glfw_error(),
                           "a display: DISPLAY names an X server",
                           "without a screen: xvfb-run -s '-screen 0 1600x900x24' heddle view ..."});
  }
  session_.start();
  (void)session_.report(report_, serial_);
  open_window();
}

Window::~Window() {
  if (window_ != nullptr) {
    ImGui_ImplOpenGL3_Shutdown();
    ImGui_ImplGlfw_Shutdown();
    ImGui::DestroyContext();
    glfwDestroyWindow(window_);
  }
  // The session may still wake the window's loop: GLFW ends after it.
}

void Window::open_window() {
  const Json& extent = report_.variants[0].description.at("extent");
  int width = static_cast<int>(application_.width), height = static_cast<int>(application_.height);
  if (width == 0 || height == 0) {
    width = std::max(extent.at(0).get<int>(), kLeastPicture[0]) + static_cast<int>(kPanelWidth);
    height = std::max(extent.at(1).get<int>(), kLeastPicture[1]) + static_cast<int>(kStatusHeight);
    if (GLFWmonitor* monitor = glfwGetPrimaryMonitor(); monitor != nullptr) {
      int x = 0, y = 0, most_wide = 0, most_high = 0;
      glfwGetMonitorWorkarea(monitor, &x, &y, &most_wide, &most_high);
      if (most_wide > 0) width = std::min(width, most_wide);
      if (most_high > 0) height = std::min(height, most_high);
    }
  }
  glfwWindowHint(GLFW_CONTEXT_VERSION_MAJOR, 3);
  glfwWindowHint(GLFW_CONTEXT_VERSION_MINOR, 2);
  glfwWindowHint(GLFW_OPENGL_PROFILE, GLFW_OPENGL_CORE_PROFILE);
  // The bytes are encoded already; a screen takes them as they are.
  glfwWindowHint(GLFW_SRGB_CAPABLE, GLFW_FALSE);
  window_ = glfwCreateWindow(width, height, "Heddle", nullptr, nullptr);
  if (window_ == nullptr) {
    throw Error(HEDDLE_UNSUPPORTED,
                Diagnostic{Severity::kError,
                           {},
                           "no window can be opened",
                           glfw_error(),
                           "OpenGL 3.2",
                           "the Debian package libgl1-mesa-dri draws on the CPU where nothing else can"});
  }
  glfwMakeContextCurrent(window_);
  const auto told = [](GLenum name) {
    const auto* text = reinterpret_cast<const char*>(glGetString(name));
    return std::string(text != nullptr ? text : "?");
  };
  drawn_by_ = fmt::format("{}, OpenGL {}", told(GL_RENDERER), told(GL_VERSION));
  glfwSwapInterval(1);
  glfwSetWindowUserPointer(window_, &frames_to_draw_);
  // Before Dear ImGui's, which call these.
  glfwSetCursorPosCallback(window_, [](GLFWwindow* window, double, double) { note_event(window); });
  glfwSetMouseButtonCallback(window_, [](GLFWwindow* window, int, int, int) { note_event(window); });
  glfwSetScrollCallback(window_, [](GLFWwindow* window, double, double) { note_event(window); });
  glfwSetKeyCallback(window_, [](GLFWwindow* window, int, int, int, int) { note_event(window); });
  glfwSetCharCallback(window_, [](GLFWwindow* window, unsigned) { note_event(window); });
  glfwSetCursorEnterCallback(window_, [](GLFWwindow* window, int) { note_event(window); });
  glfwSetWindowFocusCallback(window_, [](GLFWwindow* window, int) { note_event(window); });
  glfwSetWindowRefreshCallback(window_, note_event);
  glfwSetFramebufferSizeCallback(window_, [](GLFWwindow* window, int, int) { note_event(window); });
  IMGUI_CHECKVERSION();
  ImGui::CreateContext();
  ImGuiIO& io = ImGui::GetIO();
  io.IniFilename = nullptr;  // the window leaves nothing behind
  io.ConfigInputTextCursorBlink = false;
  ImGui::StyleColorsDark();
  ImGui::GetStyle().WindowBorderSize = 0;
  ImGui::GetStyle().WindowRounding = 0;
  float scale_x = 1, scale_y = 1;
  glfwGetWindowContentScale(window_, &scale_x, &scale_y);
  if (scale_x > 1) io.FontGlobalScale = scale_x;
  ImGui_ImplGlfw_InitForOpenGL(window_, true);
  ImGui_ImplOpenGL3_Init("#version 150");
}

void Window::upload(Texture& texture, std::uint32_t width, std::uint32_t height,
                    const std::vector<std::uint8_t>& rgba) {
  if (texture.id == 0) {
    glGenTextures(1, &texture.id);
    glBindTexture(GL_TEXTURE_2D, texture.id);
    // Smaller than it is, the picture is averaged; larger, its pixels are seen as they are.
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_S, static_cast<GLint>(kClampToEdge));
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_WRAP_T, static_cast<GLint>(kClampToEdge));
  }
  glBindTexture(GL_TEXTURE_2D, texture.id);
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  const auto wide = static_cast<GLsizei>(width), high = static_cast<GLsizei>(height);
  if (texture.width == width && texture.height == height) {
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, wide, high, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  } else {
    glTexImage2D(GL_TEXTURE_2D, 0, GL_RGBA8, wide, high, 0, GL_RGBA, GL_UNSIGNED_BYTE, rgba.data());
  }
  texture.width = width;
  texture.height = height;
}

void Window::upload_pictures() {
  for (Variant v = 0; v < kVariants; ++v) {
    const auto& picture = report_.variants[v].picture;
    if (!picture || textures_[v].serial == picture->serial) continue;
    upload(textures_[v], picture->width, picture->height, picture->rgba);
    textures_[v].serial = picture->serial;
  }
  const auto& a = report_.variants[0].picture;
  const auto& b = report_.variants[1].picture;
  if (mode_ != Mode::kDifference || !a || !b) return;
  // With the gain, which only scales what is shown.
  const std::array<std::uint64_t, kVariants> of{a->serial, b->serial};
  const auto gain_serial = static_cast<std::uint64_t>(std::lround(1000 * gain_));
  if (of == difference_of_ && difference_.serial == gain_serial) return;
  if (a->width != b->width || a->height != b->height) {
    difference_text_ =
        fmt::format("A is {} x {}, B {} x {}: they have no difference", a->width, a->height, b->width, b->height);
    const std::vector<std::uint8_t> black{0, 0, 0, 255};
    upload(difference_, 1, 1, black);
  } else {
    std::vector<std::uint8_t> rgba;
    const Distance distance = difference(*a, *b, gain_, rgba);
    upload(difference_, a->width, a->height, rgba);
    difference_text_ = fmt::format("|A - B|: at most {} of 255, root mean square {:.3f}, {} pixels differ",
                                   distance.maximum, distance.root_mean_square, distance.differing_pixels);
  }
  difference_of_ = of;
  difference_.serial = gain_serial;
}

void Window::save_window(const std::string& file) {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  const auto wide = static_cast<std::size_t>(width), high = static_cast<std::size_t>(height);
  std::vector<std::uint8_t> rgb(3 * wide * high), flipped(rgb.size());
  glPixelStorei(GL_PACK_ALIGNMENT, 1);
  glReadPixels(0, 0, width, height, GL_RGB, GL_UNSIGNED_BYTE, flipped.data());
  for (std::size_t y = 0; y < high; ++y)
    std::copy_n(flipped.begin() + static_cast<std::ptrdiff_t>(3 * wide * (high - 1 - y)), 3 * wide,
                rgb.begin() + static_cast<std::ptrdiff_t>(3 * wide * y));
  last_order_ =
      session_.order(fmt::format("write {}", file), [file, width, height, rgb = std::move(rgb)](Session& session) {
        session.write_image(file, static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height), rgb);
      });
}

bool Window::is_pressed(int key) const {
  return !ImGui::GetIO().WantTextInput && ImGui::IsKeyPressed(key, false);
}

void Window::keys() {
  if (is_pressed(GLFW_KEY_SPACE))
    last_order_ = session_.order("play", [plays = !report_.is_playing](Session& session) { session.play(plays); });
  if (is_pressed(GLFW_KEY_PERIOD)) last_order_ = session_.order("step", [](Session& session) { session.step(true); });
  if (is_pressed(GLFW_KEY_COMMA)) last_order_ = session_.order("step", [](Session& session) { session.step(false); });
  if (is_pressed(GLFW_KEY_X)) last_order_ = session_.order("cut", [](Session& session) { session.cut(); });
  if (report_.variants[1].is_there) {
    if (is_pressed(GLFW_KEY_TAB)) mode_ = mode_ == Mode::kA ? Mode::kB : Mode::kA;
    for (int i = 0; i < 4; ++i)
      if (is_pressed(GLFW_KEY_1 + i)) mode_ = static_cast<Mode>(i);
  }
  if (is_pressed(GLFW_KEY_HOME)) {
    scene_camera_ = -1;
    camera_order_ = last_order_ = session_.order("camera", [](Session& session) { session.use_camera(HEDDLE_NONE); });
  }
  if (is_pressed(GLFW_KEY_L)) {
    level_camera();
  }
  const int cameras = report_.scene ? static_cast<int>(report_.scene->at("cameras").size()) : 0;
  if (cameras > 0 && (is_pressed(GLFW_KEY_PAGE_DOWN) || is_pressed(GLFW_KEY_PAGE_UP))) {
    const int next = is_pressed(GLFW_KEY_PAGE_DOWN) ? scene_camera_ + 1 : std::max(scene_camera_, 0) + cameras - 1;
    use_scene_camera(next % cameras);
  }
  if (is_pressed(GLFW_KEY_B)) bookmarks_.push_back({fmt::format("bookmark {}", bookmarks_.size() + 1), camera_});
  if (is_pressed(GLFW_KEY_I)) {
    const ImVec2 pixel = pixel_at(ImGui::GetIO().MousePos);
    if (pixel.x >= 0) {
      last_order_ = session_.order("inspect", [pixel](Session& session) {
        session.inspect(static_cast<std::uint32_t>(pixel.x), static_cast<std::uint32_t>(pixel.y));
      });
    }
  }
  if (is_pressed(GLFW_KEY_F12)) {
    do {
      shot_file_ = fmt::format("heddle-view-{:03}.png", ++shots_);
    } while (access(shot_file_.c_str(), F_OK) == 0);
  }
  if (ImGui::IsKeyPressed(GLFW_KEY_ESCAPE, false)) session_.stop_measuring();
}

void Window::draw() {
  ImGui_ImplOpenGL3_NewFrame();
  ImGui_ImplGlfw_NewFrame();
  put_script_input();
  ImGui::NewFrame();
  widgets_.clear();
  last_field_ = std::exchange(field_, {});
  upload_pictures();
  const ImVec2 size = ImGui::GetIO().DisplaySize;
  const float scale = ImGui::GetIO().FontGlobalScale;
  const float panel_x = std::max(size.x - kPanelWidth * scale, size.x * 0.3F),
              status_y = size.y - kStatusHeight * scale;
  canvas({0, 0}, {panel_x, status_y});
  status_bar({0, status_y}, size);
  panel({panel_x, 0}, {size.x, status_y});
  keys();
  fly_by_keys();
  ImGui::Render();
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  glViewport(0, 0, width, height);
  glClearColor(0.1F, 0.1F, 0.1F, 1);
  glClear(GL_COLOR_BUFFER_BIT);
  ImGui_ImplOpenGL3_RenderDrawData(ImGui::GetDrawData());
  if (!shot_file_.empty()) save_window(std::exchange(shot_file_, {}));
  glfwSwapBuffers(window_);
  ++draws_;
}

void Window::run() {
  while (glfwWindowShouldClose(window_) == GLFW_FALSE && !session_.is_stopped()) {
    play_script();
    if (glfwWindowShouldClose(window_) != GLFW_FALSE) break;
    if (frames_to_draw_ > 0) {
      --frames_to_draw_;
      draw();
    }
    if (is_flying()) {
      frames_to_draw_ = std::max(frames_to_draw_, 1);
      if (scripted())
        glfwPollEvents();
      else
        glfwWaitEventsTimeout(kFlyingPause);
    } else if (frames_to_draw_ > 0) {
      glfwPollEvents();
    } else if (scripted()) {
      glfwWaitEventsTimeout(0.05);
    } else {
      glfwWaitEvents();
    }
    if (session_.report(report_, serial_)) {
      std::erase_if(edits_, [&](const auto& edit) { return edit.second.order <= report_.orders_done; });
      frames_to_draw_ = std::max(frames_to_draw_, 2);
      if (!report_.variants[1].is_there && mode_ != Mode::kA) mode_ = Mode::kA;
    }
  }
}

}  // namespace heddle::view

// ---- entry ----

namespace {

heddle_status fail_run(heddle_status status, const char* message, char* error, std::size_t size) {
  if (size > 0) {
    std::strncpy(error, message, size - 1);
    error[size - 1] = '\0';
  }
  return status;
}

}  // namespace

heddle_status heddle_view_run(const heddle_view_application* application, char* error, std::size_t error_size) {
  if (application->struct_size < sizeof *application || application->revision != HEDDLE_VIEW_MODULE_REVISION)
    return fail_run(HEDDLE_BUG, "error: this is not the window of this version of Heddle", error, error_size);
  heddle_status status = HEDDLE_OK;
  try {
    heddle::view::Window window(*application);
    window.run();
    if (window.is_stopped()) status = fail_run(HEDDLE_CANCELLED, "stopped", error, error_size);
  } catch (const heddle::Error& thrown) {
    std::string_view text = thrown.what();
    while (text.starts_with("error: error: ")) text.remove_prefix(7);
    status = fail_run(thrown.status(), std::string(text).c_str(), error, error_size);
  } catch (const std::exception& thrown) {
    status = fail_run(HEDDLE_FAILED, thrown.what(), error, error_size);
  }
  glfwTerminate();
  return status;
}

void heddle_view_tell(void* view, std::uint32_t severity, const char* text) {
  static_cast<heddle::view::Session*>(view)->tell(severity, text);
}

std::uint32_t heddle_view_progress(void* view, const char* activity, double fraction) {
  return static_cast<heddle::view::Session*>(view)->progress(activity, fraction);
}
