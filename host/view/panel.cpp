// SPDX-License-Identifier: Apache-2.0
// The right side: every pass with its technique and parameters, what knobs cost, times, explanations, the scene.
#include "view/catalog.hpp"
#include "view/fly.hpp"
#include "view/knob.hpp"
#include "view/window.hpp"

#include <fmt/format.h>
#include <imgui/imgui_stdlib.h>

#include <algorithm>
#include <cmath>

namespace heddle::view {

namespace {

const ImVec4 kKnobColor{1.0F, 0.78F, 0.35F, 1};
const ImVec4 kFaint{0.6F, 0.6F, 0.6F, 1};
constexpr float kTip = 380;  // width of a tooltip's text

void tip(const std::string& text) {
  if (text.empty() || !ImGui::IsItemHovered()) return;
  ImGui::BeginTooltip();
  ImGui::PushTextWrapPos(kTip);
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopTextWrapPos();
  ImGui::EndTooltip();
}

std::string number_text(double value) {
  return fmt::format("{:.5g}", value);
}

std::string ms_text(double ms) {
  return fmt::format("{:.{}f}", ms, ms < 10 ? 2 : ms < 100 ? 1 : 0);
}

/// A value of the parameter as people read it.
std::string value_text(const Json& value) {
  if (value.is_number_float()) return number_text(value.get<double>());
  return value.is_string() ? value.get<std::string>() : write_json(value);
}

std::string help_of(const Json& parameter) {
  std::string text = parameter.value("help", std::string{});
  const std::string type = parameter.at("type").get<std::string>();
  const std::string unit = parameter.value("unit", std::string{});
  if (type == "float" || type == "int" || type == "float3" || type == "color") {
    text +=
        fmt::format("\n{} to {}{}", number_text(parameter.at("minimum").get<double>()),
                    number_text(parameter.at("maximum").get<double>()), unit == "1" || unit.empty() ? "" : " " + unit);
  }
  const Json ladder = parameter.value("ladder", Json::array());
  if (!ladder.empty()) {
    text += "\na knob, from cheap to accurate:";
    for (const Json& step : ladder) {
      const auto index = static_cast<std::size_t>(step.get<double>());
      text += " " + (type == "choice" ? parameter.at("choices").at(index).get<std::string>()
                                      : number_text(step.get<double>()));
    }
  }
  return text;
}

}  // namespace

std::string cost_text(const Cost& cost) {
  return fmt::format("{}: {} ms", value_text(cost.value), ms_text(cost.ms.value));
}

Variant Window::edited() const {
  return report_.variants[edited_].is_there ? edited_ : 0;
}

void Window::set(const std::string& key, const std::string& value) {
  for (Variant v = 0; v < kVariants; ++v) {
    if (!report_.variants[v].is_there || (!edits_both_ && v != edited())) continue;
    const std::string name = fmt::format("{} {}", kVariantNames[v], key);
    last_order_ = session_.order(name, [v, setting = key + "=" + value](Session& session) { session.set(v, setting); });
    try {
      edits_[name] = {parse_json(value), last_order_};
    } catch (const Json::parse_error&) {
      edits_.erase(name);  // no JSON, whatever TOML makes of it: what the graph says is shown
    }
  }
}

Json Window::shown_value(const std::string& key, const Json& told) const {
  const auto edit = edits_.find(fmt::format("{} {}", kVariantNames[edited()], key));
  return edit != edits_.end() ? edit->second.value : told;
}

void Window::panel(ImVec2 low, ImVec2 high) {
  ImGui::SetNextWindowPos(low);
  ImGui::SetNextWindowSize({high.x - low.x, high.y - low.y});
  ImGui::Begin("panel", nullptr, ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove);
  if (ImGui::BeginTabBar("tabs")) {
    using Tab = void (Window::*)();
    constexpr std::array<std::pair<const char*, Tab>, 6> kTabs{{{"passes", &Window::passes_tab},
                                                                {"times", &Window::times_tab},
                                                                {"explain", &Window::explain_tab},
                                                                {"pixel", &Window::pixel_tab},
                                                                {"scene", &Window::scene_tab},
                                                                {"help", &Window::messages_tab}}};
    for (const auto& [name, tab] : kTabs) {
      const bool is_wanted = tab_to_open_ == name;
      if (is_wanted) tab_to_open_.clear();
      const bool is_open = ImGui::BeginTabItem(name, nullptr, is_wanted ? ImGuiTabItemFlags_SetSelected : 0);
      mark(fmt::format("tab/{}", name));
      if (!is_open) continue;
      ImGui::BeginChild(name);
      (this->*tab)();
      ImGui::EndChild();
      ImGui::EndTabItem();
    }
    ImGui::EndTabBar();
  }
  ImGui::End();
}

// ---- passes ----

void Window::passes_tab() {
  const bool has_b = report_.variants[1].is_there;
  if (has_b) {
    ImGui::AlignTextToFramePadding();
    ImGui::TextUnformatted("change");
    for (int choice = 0; choice < 3; ++choice) {
      constexpr std::array<const char*, 3> kChoices{"A", "B", "both"};
      const bool is_chosen = choice == 2 ? edits_both_ : !edits_both_ && edited_ == static_cast<Variant>(choice);
      ImGui::SameLine();
      if (ImGui::RadioButton(kChoices.at(static_cast<std::size_t>(choice)), is_chosen)) {
        edits_both_ = choice == 2;
        if (choice < 2) edited_ = static_cast<Variant>(choice);
      }
      mark(fmt::format("change/{}", kChoices.at(static_cast<std::size_t>(choice))));
    }
    ImGui::SameLine(0, 20);
  }
  if (ImGui::Button(has_b ? "copy A to B" : "compare: A | B")) {
    last_order_ = session_.order("copy", [](Session& session) { session.copy_a_to_b(); });
    if (!has_b) {
      mode_ = Mode::kWipe;
      edited_ = 1;
    }
  }
  mark("compare");
  tip("makes B what A is now; then change one of them");
  if (has_b) {
    ImGui::SameLine();
    if (ImGui::Button("close B")) {
      last_order_ = session_.order("copy", [](Session& session) { session.remove_b(); });
      edits_both_ = false;
      edited_ = 0;
    }
    mark("close B");
  }
  const VariantReport& variant = report_.variants[edited()];
  if (!report_.list || !variant.is_there) return;
  ImGui::TextColored(kFaint, "%s: %s", kVariantNames[edited()], variant.graph.c_str());
  ImGui::SameLine();
  if (ImGui::SmallButton("copy --set")) {
    std::string line;
    for (const std::string& setting : variant.settings) line += fmt::format("--set '{}' ", setting);
    glfwSetClipboardString(window_, line.c_str());
  }
  mark("copy settings");
  tip("what was set, as words for heddle run");
  const Json extent = shown_value("extent", variant.description.at("extent"));
  std::array<int, 2> size{extent.at(0).get<int>(), extent.at(1).get<int>()};
  ImGui::SetNextItemWidth(140);
  if (ImGui::InputInt2("extent", size.data(), ImGuiInputTextFlags_EnterReturnsTrue))
    set("extent", fmt::format("[{},{}]", size[0], size[1]));
  mark("extent");
  const Json& presets = variant.description.at("presets");
  if (!presets.empty()) ImGui::Separator();
  for (const auto& [name, told] : presets.items()) {
    const std::string key = "params." + name;
    const Json value = shown_value(key, told);
    if (value.is_number()) {
      double number = value.get<double>();
      ImGui::SetNextItemWidth(140);
      if (ImGui::InputDouble(name.c_str(), &number, 0, 0, "%.9g",
                             ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_AutoSelectAll))
        set(key, value.is_number_integer() && number == std::floor(number)
                     ? write_json(Json(static_cast<std::int64_t>(number)))
                     : write_json(Json(number)));
      mark(key);
    } else {
      ImGui::Text("%s  %s", name.c_str(), write_json(value).c_str());
    }
    tip("a preset of the graph: $" + name);
  }
  ImGui::Separator();
  for (const Json& pass : variant.description.at("passes")) pass_block(pass);
}

void Window::pass_block(const Json& pass) {
  const auto name = pass.at("name").get<std::string>();
  const auto technique = shown_value(name + ".technique", pass.at("technique")).get<std::string>();
  const bool is_left_out = pass.value("is_left_out", false);
  ImGui::PushID(name.c_str());
  const std::string title = fmt::format("{}   {}###pass", name, is_left_out ? technique + " (left out)" : technique);
  const bool is_open = ImGui::CollapsingHeader(title.c_str());
  mark("pass/" + name);
  if (is_open) {
    ImGui::SetNextItemWidth(180);
    const bool is_choosing = ImGui::BeginCombo("technique", technique.c_str());
    mark(name + ".technique");
    if (is_choosing) {
      std::vector<std::pair<std::string, std::string>> choices{{"none", "the role's neutral value"}};
      for (const Json& candidate : report_.list->at("techniques"))
        if (candidate.at("role") == pass.at("role"))
          choices.emplace_back(candidate.at("name").get<std::string>(), candidate.value("title", std::string{}));
      for (const auto& [choice, help] : choices) {
        if (ImGui::Selectable(choice.c_str(), choice == technique)) set(name + ".technique", write_json(Json(choice)));
        mark(fmt::format("{}.technique/{}", name, choice));
        tip(help);
      }
      ImGui::EndCombo();
    }
    ImGui::SameLine();
    if (ImGui::SmallButton("why")) {
      explained_ = name;
      tab_to_open_ = "explain";
    }
    mark(name + "/why");
    tip("says why this pass runs, or does not");
    const Json* known = technique_of(*report_.list, pass);
    if (known != nullptr && !is_left_out && !known->at("parameters").empty() &&
        ImGui::BeginTable("parameters", 3, ImGuiTableFlags_SizingFixedFit)) {
      ImGui::TableSetupColumn("name", ImGuiTableColumnFlags_WidthFixed, 136);
      ImGui::TableSetupColumn("value", ImGuiTableColumnFlags_WidthFixed, 200);
      ImGui::TableSetupColumn("cost", ImGuiTableColumnFlags_WidthStretch);
      for (const Json& parameter : known->at("parameters")) parameter_row(pass, parameter);
      ImGui::EndTable();
    }
  }
  ImGui::PopID();
}

void Window::parameter_row(const Json& pass, const Json& parameter) {
  const auto name = parameter.at("name").get<std::string>();
  const auto type = parameter.at("type").get<std::string>();
  const Json& told = pass.at("parameters");
  if (!told.contains(name)) return;  // the list is newer than the graph
  const std::string key = pass.at("name").get<std::string>() + ".params." + name;
  const Json value = shown_value(key, told.at(name));
  const bool is_knob = !parameter.value("ladder", Json::array()).empty();
  ImGui::TableNextRow();
  ImGui::TableNextColumn();
  ImGui::PushID(name.c_str());
  ImGui::AlignTextToFramePadding();
  if (is_knob)
    ImGui::TextColored(kKnobColor, "%s", name.c_str());
  else
    ImGui::TextUnformatted(name.c_str());
  tip(help_of(parameter));
  ImGui::TableNextColumn();
  ImGui::SetNextItemWidth(-1);
  if (type == "float" || type == "int") {
    numeric_widget(key, parameter, value);
  } else if (type == "bool") {
    bool is_on = value.is_boolean() && value.get<bool>();
    if (ImGui::Checkbox("##value", &is_on)) set(key, is_on ? "true" : "false");
    mark(key);
  } else if (type == "choice") {
    const std::string present = value_text(value);
    const bool is_choosing = ImGui::BeginCombo("##value", present.c_str());
    mark(key);
    if (is_choosing) {
      for (const Json& choice : parameter.at("choices")) {
        const auto word = choice.get<std::string>();
        if (ImGui::Selectable(word.c_str(), word == present)) set(key, write_json(choice));
        mark(key + "/" + word);
      }
      ImGui::EndCombo();
    }
  } else if ((type == "float3" || type == "color") && value.is_array() && value.size() == 3) {
    std::array<float, 3> numbers{};
    for (std::size_t i = 0; i < 3; ++i) numbers[i] = value[i].get<float>();
    const auto low = parameter.at("minimum").get<float>(), high = parameter.at("maximum").get<float>();
    const bool is_changed = type == "color" ? ImGui::ColorEdit3("##value", numbers.data(),
                                                                ImGuiColorEditFlags_Float | ImGuiColorEditFlags_HDR)
                                            : ImGui::DragFloat3("##value", numbers.data(), 0.005F, low, high, "%.4g");
    // What the widget makes of a number is a float32: its own shortest digits, not those of its float64.
    if (is_changed) set(key, fmt::format("[{},{},{}]", numbers[0], numbers[1], numbers[2]));
    mark(key);
  } else {  // texts and lists of names, as TOML writes them
    std::string& text = typed_[key];
    const std::string present = value.is_string() ? value.get<std::string>() : write_json(value);
    if (last_field_ != key) text = present;
    if (ImGui::InputText("##value", &text, ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_AutoSelectAll))
      set(key, value.is_string() ? write_json(Json(text)) : text);
    if (ImGui::IsItemActive()) field_ = key;
    mark(key);
  }
  if (type != "float" && type != "int") tip(help_of(parameter));
  ImGui::TableNextColumn();
  if (is_knob) cost_cell(pass, parameter, value);
  ImGui::PopID();
}

void Window::numeric_widget(const std::string& key, const Json& parameter, const Json& value) {
  const Track track(parameter);
  const double number = value.is_number() ? value.get<double>() : 0;
  const auto text_of = [&](double wanted) {
    return track.is_integer() ? write_json(Json(static_cast<std::int64_t>(std::llround(wanted))))
                              : write_json(Json(wanted));
  };
  constexpr float kField = 62;
  ImGui::SetNextItemWidth(200 - kField - ImGui::GetStyle().ItemInnerSpacing.x);
  auto position = static_cast<float>(track.position_of(number));
  const std::string shown = value_text(value);
  std::string format;  // the value itself: what the slider holds is a place
  for (const char c : shown) format += c == '%' ? "%%" : std::string(1, c);
  if (ImGui::SliderFloat("##slider", &position, 0, static_cast<float>(track.end()), format.c_str(),
                         ImGuiSliderFlags_NoInput | ImGuiSliderFlags_NoRoundToFormat)) {
    const double wanted = track.value_at(static_cast<double>(position));
    if (wanted != number) set(key, text_of(wanted));
  }
  mark(key);
  tip(help_of(parameter));
  if (track.ladder().size() > 1) {
    // Detents: where the ladder's steps are.
    const ImVec2 low = ImGui::GetItemRectMin(), high = ImGui::GetItemRectMax();
    const float pad = 2 + 0.5F * ImGui::GetStyle().GrabMinSize;
    for (std::size_t i = 0; i < track.ladder().size(); ++i) {
      const float x =
          low.x + pad + (high.x - low.x - 2 * pad) * static_cast<float>(i) / static_cast<float>(track.end());
      ImGui::GetWindowDrawList()->AddLine({x, high.y - 4}, {x, high.y}, ImGui::GetColorU32(kKnobColor));
    }
  }
  ImGui::SameLine(0, ImGui::GetStyle().ItemInnerSpacing.x);
  ImGui::SetNextItemWidth(kField);
  std::string& typed = typed_[key];
  if (last_field_ != key) typed = write_json(value);
  if (ImGui::InputText("##field", &typed,
                       ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_AutoSelectAll |
                           ImGuiInputTextFlags_CharsScientific))
    set(key, typed);
  if (ImGui::IsItemActive()) field_ = key;
  mark(key + "/field");
}

/// What the frame takes with each step of the ladder, the present one first.
void Window::cost_cell(const Json& pass, const Json& parameter, const Json& value) {
  const auto pass_name = pass.at("name").get<std::string>(), name = parameter.at("name").get<std::string>();
  const std::string key = pass_name + ".params." + name;
  const VariantReport& variant = report_.variants[edited()];
  const auto found = variant.costs.find(key);
  if (ImGui::SmallButton("time")) {
    last_order_ = session_.order(
        "measure " + key, [v = edited(), pass_name, name](Session& session) { session.measure(v, pass_name, name); });
  }
  mark(key + "/time");
  tip("times the frame with each step of the ladder for this view; the steps take turns. Escape stops it");
  if (found == variant.costs.end()) return;
  const Costs& costs = found->second;
  // The knob's own setting is what the steps differ by.
  std::string rest = variant.situation, line_start = "\n" + key + "=";
  if (const std::size_t at = rest.find(line_start); at != std::string::npos) {
    const std::size_t end = rest.find('\n', at + 1);
    rest.erase(at, end == std::string::npos ? std::string::npos : end - at);
  }
  const bool is_present = rest == costs.situation;
  const auto here = std::ranges::find(costs.steps, value, &Cost::value);
  ImGui::SameLine();
  const std::string shown = here == costs.steps.end() ? "-"
                            : !here->error.empty()    ? "error"
                                                      : ms_text(here->ms.value) + " ms";
  if (is_present)
    ImGui::TextUnformatted(shown.c_str());
  else
    ImGui::TextColored(kFaint, "(%s)", shown.c_str());
  std::string table = is_present ? "the frame, from its first submission to its last fence:\n"
                                 : "of another view, or with other settings, than now:\n";
  for (const Cost& cost : costs.steps)
    table += cost.error.empty() ? fmt::format("{:>10}  {:8.2f} ms  [{:.2f}, {:.2f}]\n", value_text(cost.value),
                                              cost.ms.value, cost.ms.low, cost.ms.high)
                                : fmt::format("{:>10}  {}\n", value_text(cost.value), cost.error);
  for (const Cost& cost : costs.steps) {
    if (!cost.error.empty()) continue;
    table +=
        fmt::format("medians of frames that took turns, with what holds them at {:.0f} %", 100 * cost.ms.confidence);
    break;
  }
  tip(table);
  // The steps' medians as bars under each other; intervals lie below the numbers, which they must not strike through.
  double most = 0;
  for (const Cost& cost : costs.steps) most = std::max(most, cost.ms.high);
  if (most <= 0) return;
  for (const Cost& cost : costs.steps) {
    if (!cost.error.empty()) continue;
    const ImVec2 at = ImGui::GetCursorScreenPos();
    const float width = ImGui::GetContentRegionAvail().x, height = ImGui::GetTextLineHeight();
    const bool is_here = cost.value == value;
    const auto part = [&](double ms) { return at.x + width * static_cast<float>(ms / most); };
    ImDrawList* list = ImGui::GetWindowDrawList();
    const ImU32 color = is_here ? IM_COL32(255, 200, 90, 110) : IM_COL32(110, 140, 190, is_present ? 90 : 40);
    list->AddRectFilled({at.x, at.y}, {part(cost.ms.value), at.y + height - 1}, color);
    const ImVec2 low{part(cost.ms.low), at.y + height}, high{part(cost.ms.high), at.y + height + 2};
    list->AddRectFilled(low, high, IM_COL32(255, 255, 255, 170));
    ImGui::TextUnformatted(cost_text(cost).c_str());
    const std::string step = key + "/cost " + value_text(cost.value);
    mark(step);
    mark(step + "/interval", low, high);
  }
}

// ---- times ----

void Window::times_tab() {
  for (Variant v = 0; v < kVariants; ++v) {
    const VariantReport& variant = report_.variants[v];
    if (!variant.is_there) continue;
    ImGui::PushID(kVariantNames[v]);
    if (ImGui::SmallButton("time the stages"))
      last_order_ = session_.order(fmt::format("stages {}", v), [v](Session& session) { session.time_stages(v); });
    mark(fmt::format("{}/stages", kVariantNames[v]));
    ImGui::SameLine();
    ImGui::Text("%s: last frame %.2f ms, taking its picture %.2f ms", kVariantNames[v], variant.submit_ms,
                variant.read_ms);
    const Times& times = variant.times;
    if (!times.stages.empty()) {
      if (ImGui::BeginTable("stages", 4, ImGuiTableFlags_RowBg | ImGuiTableFlags_BordersInnerV)) {
        constexpr std::array<std::pair<const char*, float>, 4> kColumns{
            {{"pass", 1.1F}, {"stage", 1.5F}, {"wall ms", 0.7F}, {"CPU ms", 0.7F}}};
        for (const auto& [title, share] : kColumns)
          ImGui::TableSetupColumn(title, ImGuiTableColumnFlags_WidthStretch, share);
        ImGui::TableHeadersRow();
        for (const StageTime& stage : times.stages) {
          ImGui::TableNextRow();
          ImGui::TableNextColumn();
          ImGui::TextUnformatted(stage.pass.c_str());
          ImGui::TableNextColumn();
          ImGui::TextUnformatted(stage.stage.c_str());
          ImGui::TableNextColumn();
          ImGui::Text("%9.3f", stage.wall_ms);
          ImGui::TableNextColumn();
          ImGui::Text("%9.3f", stage.cpu_ms);
        }
        ImGui::EndTable();
      }
      const bool is_seen = times.looked_at_ms.low > times.frame_ms.high;
      const std::string cost =
          is_seen ? fmt::format("looking costs {} ms", ms_text(times.looked_at_ms.value - times.frame_ms.value))
                  : std::string("what looking costs is less than what these frames differ by");
      ImGui::TextWrapped(
          "Frame: %s ms [%s, %s]. Looked at stage by stage, each submitted and waited for alone: %s ms [%s, %s]; %s, "
          "and the sum of the stages is no frame's time. Medians of frames that took turns, with what holds them at "
          "%.0f %%.",
          ms_text(times.frame_ms.value).c_str(), ms_text(times.frame_ms.low).c_str(),
          ms_text(times.frame_ms.high).c_str(), ms_text(times.looked_at_ms.value).c_str(),
          ms_text(times.looked_at_ms.low).c_str(), ms_text(times.looked_at_ms.high).c_str(), cost.c_str(),
          100 * times.frame_ms.confidence);
    }
    ImGui::Separator();
    ImGui::PopID();
  }
  ImGui::PushStyleColor(ImGuiCol_Text, kFaint);
  ImGui::TextWrapped("%s",
                     fmt::format("{} frames, {} submissions, {:.1f} MB of pictures read in {:.0f} ms, {} drawings "
                                 "of the window\nframes: {}\nwindow: {}",
                                 report_.frames, report_.submits, 1e-6 * static_cast<double>(report_.read_bytes),
                                 report_.read_ms, draws_, report_.device, drawn_by_)
                         .c_str());
  ImGui::PopStyleColor();
}

// ---- explain, pixel ----

void Window::explain_tab() {
  const VariantReport& variant = report_.variants[edited()];
  if (!variant.is_there) return;
  ImGui::SetNextItemWidth(220);
  const bool is_choosing = ImGui::BeginCombo("##what", explained_.empty() ? "the whole graph" : explained_.c_str());
  mark("explain/what");
  if (is_choosing) {
    if (ImGui::Selectable("the whole graph", explained_.empty())) explained_.clear();
    for (const Json& pass : variant.description.at("passes")) {
      const auto name = pass.at("name").get<std::string>();
      if (ImGui::Selectable(name.c_str(), explained_ == name)) explained_ = name;
      mark("explain/" + name);
    }
    ImGui::EndCombo();
  }
  ImGui::SameLine();
  ImGui::TextColored(kFaint, "of %s", kVariantNames[edited()]);
  const bool is_stale = variant.explained_pass != explained_ || variant.explained_revision != variant.revision;
  if (is_stale) {
    if (explain_order_ <= report_.orders_done)
      explain_order_ = last_order_ =
          session_.order("explain", [v = edited(), pass = explained_](Session& session) { session.explain(v, pass); });
    ImGui::TextColored(kFaint, "asking ...");
    return;
  }
  ImGui::BeginChild("text", {0, 0}, true, ImGuiWindowFlags_HorizontalScrollbar);
  ImGui::TextUnformatted(variant.explanation.c_str());
  ImGui::EndChild();
}

void Window::pixel_tab() {
  ImGui::TextWrapped(
      "Press I over a pixel of the picture: what every image port held there, in the order of execution.");
  ImGui::BeginChild("text", {0, 0}, true, ImGuiWindowFlags_HorizontalScrollbar);
  for (Variant v = 0; v < kVariants; ++v) {
    const std::string& text = report_.variants[v].inspection;
    if (!text.empty()) ImGui::Text("%s", kVariantNames[v]);
    ImGui::TextUnformatted(text.c_str());
  }
  ImGui::EndChild();
}

// ---- scene ----

void Window::scene_tab() {
  if (!report_.scene) return;
  const Json& scene = *report_.scene;
  auto time = static_cast<float>(report_.time);
  double end = 0;
  for (const Json& animation : scene.at("animations")) end = std::max(end, animation.at("duration").get<double>());
  if (!ImGui::IsAnyItemActive()) time_edit_ = time;
  ImGui::SetNextItemWidth(220);
  if (ImGui::SliderFloat("time", &time_edit_, 0, end > 0 ? static_cast<float>(end) : 60.0F, "%.3f s"))
    last_order_ =
        session_.order("time", [to = static_cast<double>(time_edit_)](Session& session) { session.go_to(to); });
  mark("time");
  if (ImGui::Button("forget the past (X)"))
    last_order_ = session_.order("cut", [](Session& session) { session.cut(); });
  mark("cut");
  ImGui::Separator();
  ImGui::Text("camera at  %.4f  %.4f  %.4f m", camera_.position[0], camera_.position[1], camera_.position[2]);
  ImGui::Text("speed %.3g m/s", speed_);
  if (ImGui::Button("as loaded (Home)")) {
    scene_camera_ = -1;
    camera_order_ = last_order_ = session_.order("camera", [](Session& session) { session.use_camera(HEDDLE_NONE); });
  }
  mark("camera/as loaded");
  ImGui::SameLine();
  if (ImGui::Button("level (L)")) level_camera();
  mark("camera/level");
  ImGui::SameLine();
  if (ImGui::Button("bookmark (B)")) bookmarks_.push_back({fmt::format("bookmark {}", bookmarks_.size() + 1), camera_});
  mark("camera/bookmark");
  ImGui::SameLine();
  if (ImGui::Button("copy")) glfwSetClipboardString(window_, overlay_text(camera_, "view").c_str());
  mark("camera/copy");
  tip("the camera as text of an overlay, for --overlay and --camera view");
  const Json& cameras = scene.at("cameras");
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const auto name = cameras[i].get<std::string>();
    ImGui::PushID(static_cast<int>(i));
    if (ImGui::Selectable(name.c_str(), scene_camera_ == static_cast<int>(i))) use_scene_camera(static_cast<int>(i));
    mark("camera/" + name);
    ImGui::PopID();
  }
  for (std::size_t i = 0; i < bookmarks_.size(); ++i) {
    ImGui::PushID(static_cast<int>(1000 + i));
    if (ImGui::Selectable(bookmarks_[i].name.c_str())) {
      camera_ = bookmarks_[i].camera;
      send_camera();
    }
    mark("camera/" + bookmarks_[i].name);
    ImGui::PopID();
  }
  ImGui::Separator();
  for (const auto& [kind, count] : scene.at("counts").items())
    ImGui::TextColored(kFaint, "%-18s %s", kind.c_str(), write_json(count).c_str());
}

void Window::messages_tab() {
  ImGui::TextUnformatted(
      "drag             look around        W A S D Q E   fly; Shift faster\n"
      "wheel            speed              arrows        look around\n"
      "Ctrl wheel       zoom               middle drag   move the picture\n"
      "1 2 3 4          A, B, wipe, difference            Tab  A or B\n"
      "Space . ,        play, a step on, a step back      X    cut\n"
      "Home L B         camera as loaded, level, bookmark\n"
      "PageUp PageDown  cameras of the scene\n"
      "I                values of the pixel under the mouse\n"
      "F12              writes the window as a PNG         Escape  stops timing\n\n"
      "Names in yellow are knobs: they buy accuracy with time.");
  ImGui::Separator();
  ImGui::BeginChild("messages", {0, 0}, false, ImGuiWindowFlags_HorizontalScrollbar);
  for (const std::string& line : report_.messages) ImGui::TextUnformatted(line.c_str());
  ImGui::EndChild();
}

}  // namespace heddle::view
