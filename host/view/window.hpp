// SPDX-License-Identifier: Apache-2.0
// The window: shows the session's report, and orders what the mouse, the keys or a script ask for. Draws only when one
// of them or the session has something new, and sleeps otherwise.
#pragma once

#include "view/script.hpp"
#include "view/session.hpp"

#define GLFW_INCLUDE_NONE
#include <GLFW/glfw3.h>
#include <imgui/imgui.h>

#include <deque>

namespace heddle::view {

/// How A and B share the picture.
enum class Mode : int { kA, kB, kWipe, kDifference };

/// Where something that a script can name was drawn.
struct Widget {
  ImVec2 low, high;
  ImVec2 grab;  // where a slide begins, if not where it ends
  bool has_grab = false;
  bool is_visible = false;
};

/// Plays a script as the mouse and the keys of the window.
class Player {
 public:
  explicit Player(std::vector<ScriptLine> lines, std::string file) : lines_(std::move(lines)), file_(std::move(file)) {}
  [[nodiscard]] bool is_done() const { return next_ >= lines_.size(); }
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  friend class Window;
  std::vector<ScriptLine> lines_;
  std::string file_;
  std::size_t next_ = 0;
  int phase_ = 0;     // of the command
  int frames_ = 0;    // in this phase
  double until_ = 0;  // of a pause, glfwGetTime's
  ImVec2 mouse_{-1, -1}, from_{}, to_{};
  bool is_down_ = false;
  int key_ = 0;
  std::string typed_;
};

class Window {
 public:
  explicit Window(const heddle_view_application& application);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  /// Until it is closed, or a signal or the script ends it.
  void run();
  [[nodiscard]] bool is_stopped() const { return session_.is_stopped(); }

 private:
  struct Texture {
    unsigned id = 0;
    std::uint32_t width = 0, height = 0;
    std::uint64_t serial = 0;
  };

  // window.cpp
  void open_window();
  void draw();
  void upload(Texture& texture, std::uint32_t width, std::uint32_t height, const std::vector<std::uint8_t>& rgba);
  void upload_pictures();
  void save_window(const std::string& file);
  void keys();
  [[nodiscard]] bool is_pressed(int key) const;
  [[nodiscard]] bool is_flying() const;

  // canvas.cpp
  void canvas(ImVec2 low, ImVec2 high);
  void draw_pictures(ImVec2 low, ImVec2 high);
  void mouse_in_picture(ImVec2 canvas_low, ImVec2 canvas_high);
  void fly_by_keys();
  void notices(ImVec2 low, ImVec2 high);
  void status_bar(ImVec2 low, ImVec2 high);
  void send_camera();
  void take_camera();
  void level_camera();
  void use_scene_camera(int id);
  [[nodiscard]] ImVec2 pixel_at(ImVec2 mouse) const;

  // panel.cpp
  void panel(ImVec2 low, ImVec2 high);
  void passes_tab();
  void pass_block(const Json& pass);
  void parameter_row(const Json& pass, const Json& parameter);
  void numeric_widget(const std::string& key, const Json& parameter, const Json& value);
  void cost_cell(const Json& pass, const Json& parameter, const Json& value);
  void times_tab();
  void explain_tab();
  void pixel_tab();
  void scene_tab();
  void messages_tab();
  void set(const std::string& key, const std::string& value);
  [[nodiscard]] Json shown_value(const std::string& key, const Json& told) const;
  [[nodiscard]] Variant edited() const;

  // player.cpp
  void play_script();
  void put_script_input();
  void tell_state();
  void mark(const std::string& name);
  void mark(const std::string& name, ImVec2 low, ImVec2 high);
  void mark_grab(const std::string& name, ImVec2 grab);
  [[nodiscard]] bool scripted() const { return player_ != nullptr && !player_->is_done(); }
  [[noreturn]] void fail_script(const std::string& message, const std::string& found,
                                const std::string& expected) const;

  const heddle_view_application& application_;
  GLFWwindow* window_ = nullptr;
  std::string drawn_by_;  // OpenGL's renderer and version
  Session session_;
  Report report_;
  std::uint64_t serial_ = 0;
  std::uint64_t last_order_ = 0;
  int frames_to_draw_ = 3;
  std::uint64_t draws_ = 0;
  int shots_ = 0;
  std::string shot_file_;  // written after this frame

  std::array<Texture, kVariants> textures_;
  Texture difference_;
  std::array<std::uint64_t, kVariants> difference_of_{};
  std::string difference_text_;
  float gain_ = 8;

  Mode mode_ = Mode::kA;
  float wipe_ = 0.5F;
  float zoom_ = 0;  // screen pixels a picture's pixel; 0: 1, or less where it does not fit
  ImVec2 pan_{0, 0};
  ImVec2 picture_low_{0, 0}, picture_high_{0, 0};
  enum class Drag : int { kNone, kWipe, kLook, kPan } drag_ = Drag::kNone;
  bool is_hovered_ = false;

  heddle_camera camera_{};
  std::uint64_t camera_order_ = 0;
  double speed_ = 1;
  bool has_speed_ = false;
  double last_time_ = 0;
  struct Bookmark {
    std::string name;
    heddle_camera camera;
  };
  std::vector<Bookmark> bookmarks_;
  int scene_camera_ = -1;

  bool edits_both_ = false;
  Variant edited_ = 0;
  struct Edit {
    Json value;
    std::uint64_t order;
  };
  std::map<std::string, Edit> edits_;         // by variant's letter and key; until the session has done them
  std::map<std::string, std::string> typed_;  // by key, while a field is edited
  std::string field_, last_field_;            // that is edited, in this frame and the last
  std::string explained_, tab_to_open_;
  std::uint64_t explain_order_ = 0;
  float time_edit_ = 0;

  std::unique_ptr<Player> player_;
  std::map<std::string, Widget> widgets_;
  std::string scroll_to_;  // a widget that a script looks for
};

/// What stands beside the bar of a knob's step: the step and its time with the unit.
std::string cost_text(const Cost& cost);

}  // namespace heddle::view
