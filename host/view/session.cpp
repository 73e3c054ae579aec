// SPDX-License-Identifier: Apache-2.0
// Orders and file changes -> frames -> reports. All of heddle.h is called here, on one thread.
#include "view/session.hpp"

#include "diagnostics.hpp"
#include "view/catalog.hpp"
#include "view/picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

namespace heddle::view {

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kPause{200};  // between two looks at files and signals
// What takes longer is said in the window.
constexpr std::chrono::milliseconds kPatience{250};
// Frames after the last change of those graphs that remember earlier ones. Averages over time are settled long before;
// noise that is drawn anew in each frame never is, and then rests.
constexpr int kSettlingFrames = 64;
constexpr std::size_t kMostMessages = 200;
constexpr std::size_t kMostWarned = 4096;  // bytes; who warns in every frame has said it by then
constexpr std::uint32_t kWarning = 1;      // severity, as heddle_host_options.log has it
constexpr std::uint32_t kRgba8 = 37;       // VK_FORMAT_R8G8B8A8_UNORM

bool is_looping(const VariantReport& report) {
  return std::ranges::any_of(report.loops, [](const Loop& loop) { return loop.done < loop.total; });
}

void add_paths(std::set<fs::path>& files, const char* json) {
  for (const Json& file : parse_json(json)) files.emplace(file.get<std::string>());
}

}  // namespace

Session::Session(const heddle_view_application& application, std::function<void()> wake)
    : application_(application), wake_(std::move(wake)), time_(application.time), time_step_(application.time_step) {}

Session::~Session() {
  if (!thread_.joinable()) return;
  is_closing_.store(true);
  is_measuring_stopped_.store(true);
  if (heddle_host* host = cancellable_.load(); host != nullptr) heddle_cancel(host);
  {
    const std::lock_guard lock(mutex_);
    condition_.notify_all();
  }
  thread_.join();
}

void Session::start() {
  thread_ = std::thread([this] { run(); });
  std::unique_lock lock(mutex_);
  condition_.wait(lock, [this] { return is_open_ || open_error_ != nullptr; });
  if (open_error_) {
    lock.unlock();
    thread_.join();
    std::rethrow_exception(open_error_);
  }
}

std::uint64_t Session::order(const std::string& name, Order order) {
  const std::lock_guard lock(mutex_);
  std::erase_if(orders_, [&](const Waiting& waiting) { return waiting.name == name; });
  orders_.push_back({name, ++last_number_, std::move(order)});
  condition_.notify_all();
  return last_number_;
}

bool Session::report(Report& out, std::uint64_t& serial) const {
  const std::lock_guard lock(mutex_);
  if (serial == serial_) return false;
  out = published_;
  out.activity = activity_;
  out.messages.assign(messages_.begin(), messages_.end());
  out.warnings = warnings_;
  serial = serial_;
  return true;
}

void Session::tell(std::uint32_t severity, const char* text) {
  const std::lock_guard lock(mutex_);
  messages_.emplace_back(text);
  if (severity == kWarning && warnings_.size() < kMostWarned && warnings_.find(messages_.back()) == std::string::npos)
    warnings_ += (warnings_.empty() ? "" : "\n") + messages_.back();
  if (messages_.size() > kMostMessages) messages_.pop_front();
  ++serial_;
}

std::uint32_t Session::progress(const char* activity, double fraction) {
  bool is_news = false;
  if (!is_quiet_.load()) {
    const std::lock_guard lock(mutex_);
    const auto now = Clock::now();
    if (now - told_ > kPatience) {
      told_ = now;
      activity_ = fraction > 0 && fraction < 1 ? fmt::format("{} {:.0f} %", activity, 100 * fraction) : activity;
      ++serial_;
      is_news = true;
    }
  }
  if (is_news) wake_();
  return is_closing_.load() ? 1 : 0;
}

// ---- the thread ----

void Session::run() {
  try {
    open();
    // Before anybody may ask for it: who waits for the session reads the first report at once.
    publish();
    const std::lock_guard lock(mutex_);
    is_open_ = true;
    condition_.notify_all();
  } catch (...) {
    close();
    const std::lock_guard lock(mutex_);
    open_error_ = std::current_exception();
    condition_.notify_all();
    return;
  }
  while (!is_closing_.load()) {
    std::deque<Waiting> orders;
    {
      std::unique_lock lock(mutex_);
      if (orders_.empty() && !has_work())
        condition_.wait_for(lock, kPause, [this] { return !orders_.empty() || is_closing_.load(); });
      orders.swap(orders_);
      // What was warned of holds until somebody does something.
      if (!orders.empty()) warnings_.clear();
      told_ = Clock::now();
    }
    if (is_closing_.load()) break;
    if (application_.is_stopped(application_.user) != 0) {
      is_stopped_.store(true);
      wake_();
      break;
    }
    for (Waiting& waiting : orders) {
      waiting.order(*this);
      draft_.orders_done = std::max(draft_.orders_done, waiting.number);
    }
    look_at_files();
    const bool renders = has_work();
    if (renders) frame();
    if (renders || !orders.empty()) publish();
  }
  close();
}

void Session::check(heddle_status status) const {
  if (status == HEDDLE_OK) return;
  throw Error(status, std::string(heddle_error(host_)));
}

void Session::check_application(heddle_status status) const {
  if (status != HEDDLE_OK) throw Error(status, std::string(application_.error(application_.user)));
}

bool Session::guarded(Variant variant, std::string VariantReport::*message, const std::function<void()>& body) {
  try {
    body();
    (draft_.variants.at(variant).*message).clear();
    return true;
  } catch (const Error& error) {
    if (error.status() == HEDDLE_CANCELLED) return false;  // the window closes, or a signal came
    // What the host says begins with "error: " itself.
    std::string text = error.what();
    constexpr std::string_view kPrefix = "error: ";
    while (text.starts_with("error: error: ")) text.erase(0, kPrefix.size());
    draft_.variants.at(variant).*message = std::move(text);
    return false;
  }
}

void Session::open() {
  check_application(application_.open(application_.user, reinterpret_cast<heddle_view*>(this), &host_));
  cancellable_.store(host_);
  const char* text = nullptr;
  check(heddle_list(host_, &text));
  draft_.list = std::make_shared<const Json>(parse_json(text));
  const auto began = fs::file_time_type::clock::now();
  for (Variant v = 0; v < kVariants; ++v) {
    if (application_.graphs[v] == nullptr) continue;
    Side& side = sides_[v];
    side.file = application_.graphs[v];
    side.settings.assign(application_.settings[v], application_.settings[v] + application_.setting_counts[v]);
    load_graph(v);
    if (draft_.variants[v].description.at("kind") == "job") {
      throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                               {side.file, 0, 0},
                                               "this graph is a job, and there is nothing to look at",
                                               "",
                                               "a graph that renders frames",
                                               "heddle run runs it"});
    }
  }
  for (Variant v = 0; v < kVariants; ++v)
    if (exists(v)) load_scene(v);
  know_files(began);
  changed();
}

void Session::close() {
  cancellable_.store(nullptr);
  for (Side& side : sides_) {
    heddle_graph_destroy(side.graph);
    side = {};
  }
  if (host_ != nullptr) application_.close(application_.user);
  host_ = nullptr;
}

void Session::load_graph(Variant variant) {
  Side& side = sides_.at(variant);
  std::vector<const char*> settings;
  for (const std::string& setting : side.settings) settings.push_back(setting.c_str());
  heddle_graph* made = nullptr;
  check(
      heddle_graph_load(host_, side.file.c_str(), settings.data(), static_cast<std::uint32_t>(settings.size()), &made));
  heddle_graph_destroy(side.graph);
  side.graph = made;
  draft_.variants.at(variant).is_there = true;
  draft_.variants.at(variant).graph = side.file;
  describe(variant);
}

void Session::load_scene(Variant variant) {
  Side& side = sides_.at(variant);
  heddle_scene* made = nullptr;
  check_application(application_.load_scene(application_.user, static_cast<std::uint32_t>(variant), &made));
  side.scene = made;
  side.own_camera = HEDDLE_NONE;
  ++scene_revision_;
  if (variant == 0) describe_scene();
  put_camera(variant);
}

void Session::describe(Variant variant) {
  const char* text = nullptr;
  check(heddle_graph_describe(sides_.at(variant).graph, &text));
  VariantReport& report = draft_.variants.at(variant);
  report.description = parse_json(text);
  ++report.revision;
  sides_.at(variant).has_past = remembers(report.description, *draft_.list);
}

void Session::describe_scene() {
  const char* text = nullptr;
  check(heddle_scene_describe(sides_[0].scene, &text));
  draft_.scene = std::make_shared<const Json>(parse_json(text));
}

/// The flown camera is one more of the scene's; until somebody flies, the scene is as it was loaded.
void Session::put_camera(Variant variant) {
  Side& side = sides_.at(variant);
  if (flown_) {
    if (side.own_camera == HEDDLE_NONE)
      check(heddle_scene_add_camera(side.scene, "view", &*flown_, &side.own_camera));
    else
      check(heddle_scene_set_camera(side.scene, side.own_camera, &*flown_));
    check(heddle_scene_use_camera(side.scene, side.own_camera));
  } else if (used_camera_ != HEDDLE_NONE) {
    check(heddle_scene_use_camera(side.scene, used_camera_));
  } else {
    // As it was loaded: what was chosen then, or one that sees everything.
    const Json& chosen = draft_.scene->at("camera");
    check(heddle_scene_use_camera(side.scene, chosen.is_null() ? HEDDLE_NONE : chosen.get<std::uint32_t>()));
  }
}

void Session::changed() {
  frames_left_ = kSettlingFrames;
  turn_ = {};
  for (Side& side : sides_) side.is_failed = false;
}

bool Session::has_work() const {
  const bool can_render =
      std::ranges::any_of(sides_, [](const Side& side) { return side.graph != nullptr && !side.is_failed; });
  return can_render && (frames_left_ > 0 || is_playing_ || steps_left_ > 0);
}

std::string Session::situation(Variant variant, const std::string& without) const {
  const Side& side = sides_.at(variant);
  std::string text = fmt::format("{} time {} scene {} camera", side.file, time_, scene_revision_);
  const heddle_camera& camera = draft_.camera;
  for (const double number : camera.position) text += fmt::format(" {}", number);
  for (const double number : camera.rotation) text += fmt::format(" {}", number);
  text += fmt::format(" {}", camera.vertical_angle);
  for (const std::string& setting : side.settings)
    if (without.empty() || !setting.starts_with(without + "=")) text += "\n" + setting;
  return text;
}

heddle_render_options Session::options(std::uint32_t flags, double time_step) const {
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.flags = flags;
  options.time = time_;
  options.time_step = time_step;
  options.seed = application_.seed;
  options.cut = is_cut_ ? 1 : 0;
  return options;
}

void Session::publish() {
  for (Variant v = 0; v < kVariants; ++v)
    if (exists(v)) {
      draft_.variants[v].situation = situation(v, "");
      draft_.variants[v].settings = sides_[v].settings;
    }
  draft_.time = time_;
  draft_.is_playing = is_playing_;
  draft_.is_settled = !has_work();
  {
    const std::lock_guard lock(mutex_);
    published_ = draft_;
    activity_.clear();
    ++serial_;
  }
  wake_();
}

void Session::render(Variant variant, std::uint32_t flags, double time_step) {
  Side& side = sides_.at(variant);
  if (application_.pose != nullptr)
    check_application(application_.pose(application_.user, static_cast<std::uint32_t>(variant), time_));
  const heddle_render_options chosen = options(flags, time_step);
  check(heddle_render(side.graph, side.scene, &chosen));
  const char* text = nullptr;
  check(heddle_stats(side.graph, &text));
  const Json stats = parse_json(text);
  VariantReport& report = draft_.variants.at(variant);
  report.submit_ms = stats.at("submit_ms").get<double>();
  report.loops.clear();
  for (const Json& loop : stats.at("loops"))
    report.loops.push_back({loop.at("pass").get<std::string>(), loop.at("done").get<std::uint32_t>(),
                            loop.at("total").get<std::uint32_t>()});
  const auto submits = stats.at("counters").at("submits").get<std::uint64_t>();
  draft_.submits += submits;
  side.is_unread = side.is_unread || submits > 0;
  if (draft_.device.empty() && stats.contains("device")) draft_.device = stats["device"]["name"].get<std::string>();
  ++draft_.frames;
}

std::uint32_t Session::render_more(Variant variant, std::uint32_t most) {
  std::uint32_t frames = 0;
  const auto is_awaited = [&] {
    const std::lock_guard lock(mutex_);
    return !orders_.empty() || is_closing_.load();
  };
  for (; frames < most && is_looping(draft_.variants.at(variant)) && !is_awaited(); ++frames) render(variant, 0, 0.0);
  return frames;
}

/// The graph's output. 8 bits of four channels are what the window shows; nothing of them is converted.
std::shared_ptr<Picture> Session::read_picture(Side& side) {
  std::shared_ptr<Picture> made = picture_memory_.take();
  heddle_texels texels{};
  texels.struct_size = sizeof texels;
  check(heddle_read_texels(side.graph, nullptr, 0, 0, nullptr, 0, &texels));
  if (texels.format == kRgba8) {
    made->width = texels.width;
    made->height = texels.height;
    made->rgba.resize(texels.size);
    check(heddle_read_texels(side.graph, nullptr, 0, 0, made->rgba.data(), made->rgba.size(), &texels));
    draft_.read_bytes += texels.size;
    for (std::size_t at = 3; at < made->rgba.size(); at += 4) made->rgba[at] = 255;
    return made;
  }
  heddle_image shape{};
  shape.struct_size = sizeof shape;
  check(heddle_read_into(side.graph, nullptr, 0, 0, nullptr, 0, &shape));
  made->width = shape.width;
  made->height = shape.height;
  side.values.resize(std::size_t{shape.width} * shape.height * shape.channels);
  check(heddle_read_into(side.graph, nullptr, 0, 0, side.values.data(), side.values.size(), &shape));
  draft_.read_bytes += texels.size;
  made->rgba = bytes_of(side.values, shape.channels);
  return made;
}

void Session::read(Variant variant) {
  VariantReport& report = draft_.variants.at(variant);
  std::shared_ptr<const Picture>& shown = report.picture;
  const auto start = Clock::now();
  std::shared_ptr<Picture> made = read_picture(sides_.at(variant));
  sides_.at(variant).is_unread = false;
  const bool is_same =
      shown && shown->width == made->width && shown->height == made->height && shown->rgba == made->rgba;
  if (!is_same) {
    made->serial = ++picture_serial_;
    shown = std::move(made);
  }
  report.read_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
  draft_.read_ms += report.read_ms;
}

void Session::frame() {
  // Frames that are only rendered until nothing changes any more do not move the scene.
  const bool moves = is_playing_ || steps_left_ > 0;
  if (moves) {
    time_ += time_step_;
    steps_left_ = 0;
    changed();
  }
  const bool is_first = frames_left_ == kSettlingFrames;
  --frames_left_;
  const std::uint32_t frames = frames_before_picture(turn_, application_.frame_budget_ms);
  turn_ = {};
  bool goes_on = false;
  for (Variant v = 0; v < kVariants; ++v) {
    Side& side = sides_[v];
    if (!exists(v) || side.is_failed) continue;
    const std::uint64_t before = draft_.variants[v].picture ? draft_.variants[v].picture->serial : 0;
    side.is_failed = !guarded(v, &VariantReport::error, [&] {
      // What moved has arrived when nothing plays: such frames go on where loops can.
      const auto began = Clock::now();
      render(v, 0, moves ? time_step_ : 0.0);
      turn_.frames = std::max(turn_.frames, 1 + render_more(v, frames - 1));
      turn_.render_ms += std::chrono::duration<double, std::milli>(Clock::now() - began).count();
      // A frame that had nothing to do left the picture as it is.
      if (!side.is_unread && draft_.variants[v].picture) return;
      read(v);
      turn_.show_ms += draft_.variants[v].read_ms;
    });
    if (side.is_failed) continue;
    const VariantReport& report = draft_.variants[v];
    if (is_looping(report)) frames_left_ = std::max(frames_left_, 1);
    // A frame without a past is the same again; one with a past, once its bytes are.
    goes_on = goes_on || is_looping(report) || (side.has_past && (is_first || report.picture->serial != before));
  }
  is_cut_ = false;
  if (!goes_on) frames_left_ = 0;
  if (const Side& side = sides_[0]; side.scene != nullptr && draft_.variants[0].picture) {
    const Picture& picture = *draft_.variants[0].picture;
    heddle_camera camera{};
    camera.struct_size = sizeof camera;
    if (heddle_scene_get_camera(side.scene, picture.width, picture.height, &camera) == HEDDLE_OK)
      draft_.camera = camera;
  }
}

// ---- orders ----

void Session::set(Variant variant, const std::string& setting) {
  if (!exists(variant)) return;
  Side& side = sides_.at(variant);
  const bool is_set = guarded(variant, &VariantReport::refused, [&] {
    check(heddle_graph_set(side.graph, setting.c_str()));
    const std::string key = setting.substr(0, setting.find('=') + 1);
    std::erase_if(side.settings, [&](const std::string& said) { return said.starts_with(key); });
    side.settings.push_back(setting);
    describe(variant);
  });
  if (is_set) changed();
}

void Session::fly(const heddle_camera& camera) {
  flown_ = camera;
  draft_.camera = camera;
  for (Variant v = 0; v < kVariants; ++v)
    if (exists(v)) (void)guarded(v, &VariantReport::refused, [&] { put_camera(v); });
  changed();
}

void Session::use_camera(std::uint32_t id) {
  flown_.reset();
  used_camera_ = id;
  for (Variant v = 0; v < kVariants; ++v)
    if (exists(v)) (void)guarded(v, &VariantReport::refused, [&] { put_camera(v); });
  changed();
}

void Session::play(bool is_playing) {
  is_playing_ = is_playing;
  changed();
}

void Session::go_to(double time) {
  time_ = time;
  cut();
}

void Session::step(bool is_forward) {
  is_playing_ = false;
  if (is_forward)
    steps_left_ = 1;
  else
    go_to(time_ - time_step_);  // nothing that was simulated runs backwards
}

void Session::cut() {
  is_cut_ = true;
  changed();
}

void Session::copy_a_to_b() {
  Side& b = sides_[1];
  const std::string file = b.file;
  const std::vector<std::string> settings = b.settings;
  const bool was_there = exists(1);
  b.file = sides_[0].file;
  b.settings = sides_[0].settings;
  const bool is_made = guarded(1, &VariantReport::refused, [&] {
    load_graph(1);
    if (b.scene == nullptr) load_scene(1);
  });
  if (!is_made) {
    b.file = file;
    b.settings = settings;
    if (!was_there) {
      const std::string refused = draft_.variants[1].refused;
      remove_b();
      draft_.variants[0].refused = refused;
    }
    return;
  }
  know_files(fs::file_time_type::clock::now());
  changed();
}

/// The scene stays with the application, for the next B.
void Session::remove_b() {
  heddle_graph_destroy(sides_[1].graph);
  heddle_scene* scene = sides_[1].scene;
  const std::uint32_t own_camera = sides_[1].own_camera;
  sides_[1] = {};
  sides_[1].scene = scene;
  sides_[1].own_camera = own_camera;
  draft_.variants[1] = {};
}

void Session::explain(Variant variant, const std::string& pass) {
  if (!exists(variant)) return;
  VariantReport& report = draft_.variants.at(variant);
  const char* text = nullptr;
  try {
    if (pass.empty())
      check(heddle_graph_explain(sides_.at(variant).graph, "text", &text));
    else
      check(heddle_graph_explain_pass(sides_.at(variant).graph, pass.c_str(), "text", &text));
    report.explanation = text;
  } catch (const Error& error) {
    report.explanation = error.what();
  }
  report.explained_pass = pass;
  report.explained_revision = report.revision;
}

void Session::inspect(std::uint32_t x, std::uint32_t y) {
  for (Variant v = 0; v < kVariants; ++v) {
    if (!exists(v)) continue;
    Side& side = sides_[v];
    (void)guarded(v, &VariantReport::refused, [&] {
      const heddle_render_options chosen = options(HEDDLE_RENDER_ANEW, 0);
      side.is_unread = true;
      const std::array<std::uint32_t, 2> pixel{x, y};
      const char* text = nullptr;
      check(heddle_inspect(side.graph, side.scene, &chosen, pixel.data(), 1, "text", &text));
      draft_.variants[v].inspection = text;
    });
  }
}

void Session::write_image(const std::string& file, std::uint32_t width, std::uint32_t height,
                          const std::vector<std::uint8_t>& rgb) {
  std::vector<float> values(rgb.size());
  std::ranges::transform(rgb, values.begin(), [](std::uint8_t byte) { return static_cast<float>(byte) / 255.0F; });
  heddle_image image{};
  image.struct_size = sizeof image;
  image.width = width;
  image.height = height;
  image.channels = 3;
  image.pixels = values.data();
  (void)guarded(0, &VariantReport::refused, [&] {
    std::error_code ignored;  // where it cannot be made, writing the file says so
    if (const fs::path folder = fs::path(file).parent_path(); !folder.empty()) fs::create_directories(folder, ignored);
    check(heddle_image_write(host_, file.c_str(), &image));
    tell(2, fmt::format("wrote {}", file).c_str());
  });
}

// ---- files ----

void Session::know_files(fs::file_time_type began) {
  graph_files_.clear();
  scene_files_.clear();
  const char* text = nullptr;
  for (const Side& side : sides_) {
    if (side.graph == nullptr) continue;
    check(heddle_graph_files(side.graph, &text));
    add_paths(graph_files_, text);
  }
  check_application(application_.scene_files(application_.user, &text));
  add_paths(scene_files_, text);
  std::set<fs::path> all = graph_files_;
  all.insert(scene_files_.begin(), scene_files_.end());
  seen_ = stamps_after(all, seen_, began);
  last_ = seen_;
}

void Session::look_at_files() {
  const auto now = Clock::now();
  if (now - looked_at_ < kPause) return;
  looked_at_ = now;
  std::set<fs::path> all = graph_files_;
  all.insert(scene_files_.begin(), scene_files_.end());
  FileStamps stamps = stamps_of(all);
  // A compiler writes a library in many steps: only when nothing moves any more.
  const bool is_due = stamps != seen_ && stamps == last_;
  last_ = stamps;
  if (!is_due) return;
  for (const auto& [file, stamp] : stamps) {
    const auto known = seen_.find(file);
    if (known != seen_.end() && known->second == stamp) continue;
    is_graph_due_ = is_graph_due_ || graph_files_.contains(file);
    is_scene_due_ = is_scene_due_ || scene_files_.contains(file);
    tell(2, fmt::format("changed: {}", file.string()).c_str());
  }
  seen_ = std::move(stamps);
  const auto began = fs::file_time_type::clock::now();
  for (Variant v = 0; v < kVariants; ++v) {
    if (!exists(v)) continue;
    const bool is_read = guarded(v, &VariantReport::error, [&] {
      if (is_scene_due_) load_scene(v);
      if (!is_graph_due_) return;
      check(heddle_graph_reload(sides_[v].graph));
      describe(v);
    });
    if (!is_read) {
      // What failed to be read is read again at the next change, whichever file that is; the last good picture stays.
      publish();
      return;
    }
  }
  if (is_graph_due_) {
    const char* text = nullptr;
    check(heddle_list(host_, &text));
    draft_.list = std::make_shared<const Json>(parse_json(text));
  }
  is_graph_due_ = is_scene_due_ = false;
  (void)guarded(0, &VariantReport::refused, [&] { know_files(began); });
  changed();
}

}  // namespace heddle::view
