// SPDX-License-Identifier: Apache-2.0
// The thread that renders: makes the host, its scenes and the graphs of A and B, does what the window orders, renders
// until nothing changes any more, and sleeps. An application of heddle.h like any other.
#pragma once

#include "file_stamps.hpp"
#include "view/module.h"
#include "view/pace.hpp"
#include "view/picture.hpp"
#include "view/state.hpp"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

namespace heddle::view {

class Session {
 public:
  using Order = std::function<void(Session&)>;

  /// `wake`: called from any thread whenever there is something new to show.
  Session(const heddle_view_application& application, std::function<void()> wake);
  ~Session();

  // ---- from the window's thread ----

  /// Opens everything on the new thread; returns when it is open. Throws heddle::Error.
  void start();
  /// Has `order` done on the session's thread. One of the same name that waits is replaced: a slider that is dragged
  /// orders its last value alone. Answers its number, which report().orders_done reaches.
  std::uint64_t order(const std::string& name, Order order);
  /// Copies the report if it is newer than `serial`, and sets that.
  bool report(Report& out, std::uint64_t& serial) const;
  /// True when a signal asked for the end.
  [[nodiscard]] bool is_stopped() const { return is_stopped_.load(); }

  void tell(std::uint32_t severity, const char* text);
  std::uint32_t progress(const char* activity, double fraction);

  // ---- orders ----

  /// A setting of one graph, "ao.params.radius=1".
  void set(Variant variant, const std::string& setting);
  void fly(const heddle_camera& camera);
  /// HEDDLE_NONE: the one that was in use first.
  void use_camera(std::uint32_t id);
  void play(bool is_playing);
  /// To a time, as a jump: without a past.
  void go_to(double time);
  /// One frame of the time step, and there it stays.
  void step(bool is_forward);
  /// Forgets the past, as after a jump.
  void cut();
  /// B becomes what A is, which is where comparing a change with what was before begins.
  void copy_a_to_b();
  void remove_b();
  void explain(Variant variant, const std::string& pass);
  void inspect(std::uint32_t x, std::uint32_t y);
  /// Times each step of a knob's ladder for the present view.
  void measure(Variant variant, const std::string& pass, const std::string& parameter);
  /// Times the stages of the present view, and frames without looking.
  void time_stages(Variant variant);
  void write_image(const std::string& file, std::uint32_t width, std::uint32_t height,
                   const std::vector<std::uint8_t>& rgb);
  /// Ends measuring after the step that runs.
  void stop_measuring() { is_measuring_stopped_.store(true); }

 private:
  struct Side {
    heddle_graph* graph = nullptr;
    heddle_scene* scene = nullptr;
    std::string file;
    std::vector<std::string> settings;
    std::vector<float> values;  // of the last read, where texels are no bytes
    bool has_past = false;      // frames depend on those before them
    bool is_unread = false;     // the device made something since its picture was read
    bool is_failed = false;     // nothing is rendered until something changes
    std::uint32_t own_camera = HEDDLE_NONE;
  };

  void run();
  void open();
  void close();
  void load_graph(Variant variant);
  void load_scene(Variant variant);
  void describe(Variant variant);
  void describe_scene();
  void put_camera(Variant variant);
  void changed();
  void frame();
  void render(Variant variant, std::uint32_t flags, double time_step);
  /// Frames of loops that go on, until so many are rendered, or an order waits. Answers how many they are.
  std::uint32_t render_more(Variant variant, std::uint32_t most);
  void read(Variant variant);
  [[nodiscard]] std::shared_ptr<Picture> read_picture(Side& side);
  /// Of a frame at the present time.
  [[nodiscard]] heddle_render_options options(std::uint32_t flags, double time_step) const;
  void look_at_files();
  void know_files(std::filesystem::file_time_type began);
  void reload(bool graphs, bool scenes);
  [[nodiscard]] bool has_work() const;
  [[nodiscard]] bool exists(Variant variant) const { return sides_.at(variant).graph != nullptr; }
  [[nodiscard]] std::string situation(Variant variant, const std::string& without) const;
  void publish();
  /// Runs `body`; what it throws becomes that message of the variant's, which else is cleared.
  bool guarded(Variant variant, std::string VariantReport::*message, const std::function<void()>& body);
  void check(heddle_status status) const;
  void check_application(heddle_status status) const;

  heddle_view_application application_;
  std::function<void()> wake_;
  heddle_host* host_ = nullptr;
  std::array<Side, kVariants> sides_;
  Report draft_;
  double time_ = 0, time_step_ = 0;
  bool is_playing_ = false, is_cut_ = false;
  int steps_left_ = 0;
  int frames_left_ = 0;  // until it is taken for still, whatever the pictures do
  Turn turn_;            // the last one, if nothing has changed since
  std::optional<heddle_camera> flown_;
  std::uint32_t used_camera_ = HEDDLE_NONE;  // of the scene; HEDDLE_NONE: the first one's
  std::uint64_t scene_revision_ = 0, picture_serial_ = 0;
  PictureMemory picture_memory_;
  std::set<std::filesystem::path> graph_files_, scene_files_;
  FileStamps seen_, last_;
  std::chrono::steady_clock::time_point looked_at_;
  bool is_graph_due_ = false, is_scene_due_ = false;

  std::thread thread_;
  std::atomic<bool> is_closing_{false}, is_stopped_{false}, is_measuring_stopped_{false}, is_quiet_{false};
  std::atomic<heddle_host*> cancellable_{nullptr};
  mutable std::mutex mutex_;  // of everything below
  std::condition_variable condition_;
  struct Waiting {
    std::string name;
    std::uint64_t number;
    Order order;
  };
  std::deque<Waiting> orders_;
  std::uint64_t last_number_ = 0;
  Report published_;
  std::uint64_t serial_ = 0;
  std::string activity_;
  std::chrono::steady_clock::time_point told_;
  std::deque<std::string> messages_;
  std::string warnings_;  // since something was ordered
  bool is_open_ = false;
  std::exception_ptr open_error_;
};

}  // namespace heddle::view
