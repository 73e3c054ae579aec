// SPDX-License-Identifier: Apache-2.0
// Files that extend files, and settings of the command line -> one WrittenGraph in which every value keeps its place.
#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <span>

#include "graph/stages.hpp"
#include "graph/written.hpp"

namespace heddle::graph {
namespace {

constexpr std::uintmax_t kLargestFile = 16U << 20U;  // bytes; 2000 passes are 286 KiB

std::vector<std::string> names_of(const std::vector<WrittenPass>& passes) {
  std::vector<std::string> names;
  for (const WrittenPass& pass : passes) names.push_back(text_of(pass.name));
  return names;
}

auto find_pass(std::vector<WrittenPass>& passes, std::string_view name) {
  return std::ranges::find(passes, name,
                           [](const WrittenPass& pass) -> std::string_view { return text_of(pass.name); });
}

namespace fs = std::filesystem;

std::vector<std::string> graph_files(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (auto entry = fs::directory_iterator(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error))
    if (entry->path().extension() == ".toml") names.push_back(entry->path().filename().string());
  std::ranges::sort(names);
  return names;
}

/// Where a graph comes from. `named`: as somebody wrote it, from the folder of who wrote it.
class GraphPlace {
 public:
  GraphPlace(fs::path named, bool is_bare_name, const fs::path& shipped) : named_(std::move(named)) {
    if (!is_bare_name || shipped.empty()) return;
    shipped_ = shipped / named_.filename();
    if (shipped_.extension() != ".toml") shipped_ += ".toml";
  }
  [[nodiscard]] const fs::path& file() const {
    std::error_code error;
    return !shipped_.empty() && !fs::exists(named_, error) && fs::exists(shipped_, error) ? shipped_ : named_;
  }
  [[noreturn]] void report_missing(const Location& where) const {
    std::vector<std::string> names = graph_files(named_.has_parent_path() ? named_.parent_path() : fs::path("."));
    if (shipped_.empty())
      throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                               where,
                                               "there is no such graph file",
                                               named_.string(),
                                               {},
                                               did_you_mean(named_.filename().string(), names)});
    std::vector<std::string> shipped;
    for (const std::string& name : graph_files(shipped_.parent_path()))
      shipped.push_back(fs::path(name).stem().string());
    names.insert(names.end(), shipped.begin(), shipped.end());
    throw Error(HEDDLE_BAD_INPUT,
                Diagnostic{Severity::kError,
                           where,
                           fmt::format("there is neither a file nor a shipped graph '{}'", named_.filename().string()),
                           {},
                           fmt::format("one of the files {} and {}; shipped are {}", named_.string(), shipped_.string(),
                                       join_names(shipped)),
                           did_you_mean(named_.filename().string(), names)});
  }

 private:
  fs::path named_, shipped_;  // shipped_: empty where nobody may mean one
};

bool is_bare_name(const fs::path& written) {
  return !written.has_parent_path();
}

std::string read_file(const GraphPlace& place, const Location& where) {
  const fs::path& file = place.file();
  std::error_code error;
  const auto complain = [&](std::string message) -> void {
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError, where, std::move(message), file.string(), {}, {}});
  };
  if (!fs::exists(file, error)) place.report_missing(where);
  if (!fs::is_regular_file(file, error)) complain("this is no file");
  if (fs::file_size(file, error) > kLargestFile) complain("this file is larger than 16 MiB: no graph");
  std::ifstream stream(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (!stream.good() && !stream.eof()) complain("the graph file cannot be read");
  return text;
}

struct Visited {
  fs::path canonical;
  std::string name;
};

WrittenGraph read_chain(WrittenGraph written, const fs::path& folder, const fs::path& shipped,
                        std::vector<Visited>& visited);

WrittenGraph read_one(const GraphPlace& place, const fs::path& shipped, const Location& where,
                      std::vector<Visited>& visited) {
  const fs::path& file = place.file();
  const std::string text = read_file(place, where);
  std::error_code error;
  visited.push_back({fs::weakly_canonical(file, error), file.string()});
  WrittenGraph written = parse(text, file.string());
  written.files = {file.string()};
  return read_chain(std::move(written), file.parent_path(), shipped, visited);
}

WrittenGraph read_chain(WrittenGraph written, const fs::path& folder, const fs::path& shipped,
                        std::vector<Visited>& visited) {
  if (!written.extends) return written;
  const fs::path named = text_of(*written.extends);
  const GraphPlace base(folder / named, is_bare_name(named), shipped);
  std::error_code error;
  const auto again = std::ranges::find(visited, fs::weakly_canonical(base.file(), error), &Visited::canonical);
  if (again != visited.end()) {
    std::string chain;
    for (auto step = again; step != visited.end(); ++step) chain += step->name + " -> ";
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             written.extends->where,
                                             "graph files extend each other in a circle",
                                             chain + again->name,
                                             "a file at the end that extends none",
                                             {}});
  }
  WrittenGraph read = read_one(base, shipped, written.extends->where, visited);
  return overlay(std::move(read), std::move(written));
}

template <typename T>
void replace_keys(std::vector<std::pair<WrittenKey, T>>& base, std::vector<std::pair<WrittenKey, T>> over) {
  for (auto& entry : over) {
    const auto found =
        std::ranges::find(base, entry.first.name, [](const auto& e) -> const std::string& { return e.first.name; });
    if (found == base.end()) {
      base.push_back(std::move(entry));
    } else {
      *found = std::move(entry);
    }
  }
}

void merge_pass(WrittenPass& base, WrittenPass over, Problems& problems) {
  if (!text_of(over.role).empty() && text_of(over.role) != text_of(base.role))
    problems.add(over.role.where,
                 fmt::format("pass '{}' has another role in the file that is extended", text_of(base.name)),
                 "role = " + to_toml(over.role), "role = " + to_toml(base.role), "a new pass needs a name of its own");
  if (!text_of(over.technique).empty()) change_technique(base, std::move(over.technique));
  replace_keys(base.params, std::move(over.params));
  replace_keys(base.inputs, std::move(over.inputs));
  replace_keys(base.functions, std::move(over.functions));
  if (over.says_serves) {
    base.serves = std::move(over.serves);
    base.says_serves = true;
  }
  if (over.enabled) base.enabled = std::move(over.enabled);
}

/// Puts a pass where its 'after' or 'before' says; at the end without them.
void place_pass(std::vector<WrittenPass>& passes, WrittenPass pass, Problems& problems) {
  const std::optional<Written> anchor = pass.after ? pass.after : pass.before;
  const bool is_after = pass.after.has_value();
  pass.after.reset();
  pass.before.reset();
  auto place = passes.end();
  if (anchor) {
    place = find_pass(passes, text_of(*anchor));
    if (place == passes.end()) {
      problems.add(anchor->where,
                   fmt::format("pass '{}': there is no pass '{}' to stand {}", text_of(pass.name), text_of(*anchor),
                               is_after ? "after" : "before"),
                   fmt::format("{} = {}", is_after ? "after" : "before", to_toml(*anchor)),
                   "one of " + join_names(names_of(passes)), did_you_mean(text_of(*anchor), names_of(passes)));
    } else if (is_after) {
      ++place;
    }
  }
  passes.insert(place, std::move(pass));
}

/// A graph on the way to a job: its file, and the input in it that leads on.
struct Step {
  fs::path canonical;
  Location names;
  std::string job;
};

void read_jobs_of(WrittenGraph& graph, const fs::path& shipped, std::vector<Step>& chain);
void apply_setting(WrittenGraph& graph, std::string_view setting, std::size_t start, const fs::path& shipped);

WrittenGraph read_job(const GraphPlace& place, const fs::path& shipped, const Location& where,
                      std::span<const JobSetting> settings, std::vector<Step>& chain) {
  std::error_code error;
  const fs::path canonical = fs::weakly_canonical(place.file(), error);
  const auto again = std::ranges::find(chain, canonical, &Step::canonical);
  if (again != chain.end()) {
    std::string circle;
    for (auto step = again; step != chain.end(); ++step)
      circle +=
          fmt::format("{}{}:{} names '{}'", circle.empty() ? "" : ", ", step->names.file, step->names.line, step->job);
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             where,
                                             "jobs need each other's artifacts in a circle",
                                             circle,
                                             "a job at the end that needs no other",
                                             {}});
  }
  std::vector<Visited> visited;
  WrittenGraph job = read_one(place, shipped, where, visited);
  job.folder = fs::path(job.file).parent_path();
  if (!is_job(job)) {
    throw Error(HEDDLE_BAD_INPUT, Diagnostic{Severity::kError,
                                             where,
                                             fmt::format("'{}' is no job, so it makes no artifact", job.file),
                                             job.kind ? "kind = " + to_toml(*job.kind) : "a graph without 'kind'",
                                             "kind = \"job\" in that file",
                                             {}});
  }
  for (const JobSetting& setting : settings) apply_setting(job, setting.text, setting.begin, shipped);
  chain.push_back({canonical, {}, {}});
  read_jobs_of(job, shipped, chain);
  chain.pop_back();
  return job;
}

void read_jobs_of(WrittenGraph& graph, const fs::path& shipped, std::vector<Step>& chain) {
  std::vector<std::string> named;
  for (const WrittenPass& pass : graph.passes) {
    for (const auto& [port, value] : pass.inputs) {
      const std::string& text = text_of(value);
      const auto hash = text.find('#');
      if (hash == std::string::npos || hash == 0) continue;
      const std::string name = text.substr(0, hash);
      if (std::ranges::find(named, name) == named.end()) named.push_back(name);
      if (graph.jobs.contains(name)) continue;
      std::vector<JobSetting> settings;
      std::ranges::copy_if(graph.job_settings, std::back_inserter(settings),
                           [&](const JobSetting& setting) { return setting.job == name; });
      chain.back().names = value.where;
      chain.back().job = name;
      WrittenGraph job =
          read_job(GraphPlace(graph.folder / name, is_bare_name(name), shipped), shipped, value.where, settings, chain);
      const auto add = [&](const std::string& file) {
        if (std::ranges::find(graph.files, file) == graph.files.end()) graph.files.push_back(file);
      };
      for (const std::string& file : job.files) add(file);
      graph.jobs.emplace(name, std::make_shared<const WrittenGraph>(std::move(job)));
    }
  }
  Problems problems;
  for (const JobSetting& setting : graph.job_settings) {
    if (std::ranges::find(named, setting.job) != named.end()) continue;
    problems.add(
        setting.where, fmt::format("no input of the graph names the job '{}'", setting.job), setting.text,
        named.empty() ? "a setting without '#': its passes read no job's artifacts" : "one of " + join_names(named),
        did_you_mean(setting.job, named));
  }
  problems.throw_if_any();
}

/// The setting as it would be if one of the jobs that inputs name has the pass; empty if none has.
std::string setting_of_a_job(const WrittenGraph& graph, std::string_view pass, std::string_view setting,
                             std::size_t start, const fs::path& shipped) {
  WrittenGraph read = graph;
  try {
    read_jobs(read, shipped);
  } catch (const Error&) {  // of a job that cannot be read others tell; those before it are there
  }
  for (const auto& [name, job] : read.jobs)
    if (std::ranges::any_of(job->passes, [&](const WrittenPass& its) { return text_of(its.name) == pass; }))
      return fmt::format("{}{}#{}", setting.substr(0, start), name, setting.substr(start));
  return {};
}

/// The setting from its byte `start` on; what is before it names a job.
void apply_setting(WrittenGraph& graph, std::string_view setting, std::size_t start, const fs::path& shipped) {
  constexpr std::string_view kForm =
      "PASS.technique=NAME, PASS.params.NAME=VALUE, params.NAME=VALUE, extent=[W,H], output=PASS.PORT, or "
      "JOB.toml#SETTING";
  const auto characters = [&](std::size_t bytes) {  // 1 + characters before, in UTF-8
    return 1 + static_cast<std::uint32_t>(
                   std::ranges::count_if(setting.substr(0, bytes), [](char c) { return (c & 0xC0) != 0x80; }));
  };
  const auto place = [&](std::size_t bytes) { return Location{"--set", 1, characters(bytes)}; };
  Problems problems;
  const auto equals = setting.find('=', start);
  if (equals == std::string_view::npos || equals == start) {
    problems.add(place(start), equals == start ? "the setting has no key" : "the setting has no '='",
                 std::string(setting), std::string(kForm));
    problems.throw_if_any();
  }

  if (const auto hash = setting.find('#', start); hash < equals) {
    const std::string job(setting.substr(start, hash - start));
    // The last word on a key counts.
    const std::string_view key = setting.substr(0, equals + 1);
    std::erase_if(graph.job_settings, [&](const JobSetting& said) { return said.text.starts_with(key); });
    graph.job_settings.push_back({job, std::string(setting), hash + 1, place(start)});
    graph.jobs.erase(job);
    return;
  }

  std::vector<WrittenKey> path;
  for (std::size_t begin = start; begin <= equals;) {
    const std::size_t end = std::min(setting.find('.', begin), equals);
    std::size_t first = begin;
    std::size_t last = end;
    while (first < last && setting[first] == ' ') ++first;
    while (last > first && setting[last - 1] == ' ') --last;
    path.push_back({std::string(setting.substr(first, last - first)), place(first), {}});
    if (path.back().name.empty())
      problems.add(place(begin), "a part of the setting's key is empty", std::string(setting.substr(0, equals)),
                   std::string(kForm));
    begin = end + 1;
  }
  auto value = parse_value(setting.substr(equals + 1), place(equals + 1), problems);
  problems.throw_if_any();

  const std::string& first = path.front().name;
  const bool is_graph_key = first == "extent" || first == "output" || first == "params" || first == "joins";
  const auto pass = find_pass(graph.passes, first);
  if (is_graph_key) {
    assign_graph_key(graph, path, std::move(*value), problems);
  } else if (pass == graph.passes.end()) {
    std::vector<std::string> names = names_of(graph.passes);
    for (const char* key : {"extent", "output", "params", "joins"}) names.emplace_back(key);
    const std::string of_a_job = setting_of_a_job(graph, first, setting, start, shipped);
    problems.add(
        path.front().where, fmt::format("the graph has no pass '{}'", first), std::string(setting),
        "one of " + join_names(names),
        of_a_job.empty() ? did_you_mean(first, names) : fmt::format("a job that the graph names has it: {}", of_a_job));
  } else if (path.size() == 1) {
    problems.add(path.front().where, fmt::format("pass '{}': the setting says no key", first), std::string(setting),
                 std::string(kForm));
  } else if (path[1].name == "name" || path[1].name == "role" || path[1].name == "after" || path[1].name == "before") {
    problems.add(path[1].where, fmt::format("pass '{}': a setting cannot change '{}'", first, path[1].name),
                 std::string(setting), "technique, params, inputs, functions, serves or enabled",
                 "an overlay file can");
  } else {
    assign_pass_key(*pass, std::span(path).subspan(1), std::move(*value), problems);
  }
  problems.throw_if_any();
}

}  // namespace

bool is_job(const WrittenGraph& graph) {
  return graph.kind && text_of(*graph.kind) == "job";
}

void read_jobs(WrittenGraph& graph, const fs::path& shipped) {
  std::error_code error;
  std::vector<Step> chain{{fs::weakly_canonical(graph.file, error), {}, {}}};
  read_jobs_of(graph, shipped, chain);
}

WrittenGraph read_graph(const std::filesystem::path& file, const std::filesystem::path& shipped) {
  std::vector<Visited> visited;
  const GraphPlace place(file, is_bare_name(file), shipped);
  return read_one(place, shipped, {place.file().string(), 0, 0}, visited);
}

WrittenGraph read_extended(WrittenGraph written, const std::filesystem::path& folder,
                           const std::filesystem::path& shipped) {
  std::vector<Visited> visited;
  return read_chain(std::move(written), folder, shipped, visited);
}

WrittenGraph overlay(WrittenGraph base, WrittenGraph over) {
  Problems problems;
  base.file = over.file;
  base.files.insert(base.files.end(), over.files.begin(), over.files.end());
  base.extends.reset();
  if (over.kind) base.kind = std::move(over.kind);
  if (over.extent) base.extent = std::move(over.extent);
  if (over.output) base.output = std::move(over.output);
  replace_keys(base.params, std::move(over.params));
  replace_keys(base.joins, std::move(over.joins));

  for (const Written& name : over.remove) {
    const auto found = find_pass(base.passes, text_of(name));
    if (found == base.passes.end()) {
      problems.add(name.where, fmt::format("there is no pass '{}' to remove", text_of(name)), to_toml(name),
                   "one of " + join_names(names_of(base.passes)), did_you_mean(text_of(name), names_of(base.passes)));
    } else {
      base.removed.push_back({std::move(*found), name.where});
      base.passes.erase(found);
    }
  }
  base.remove.clear();

  // Passes that the overlay itself introduced; a second one of the same name is a mistake, not a change.
  std::vector<std::string> seen;
  for (WrittenPass& pass : over.passes) {
    const std::string name = text_of(pass.name);
    if (std::ranges::find(seen, name) != seen.end()) {
      problems.add(pass.where, fmt::format("pass '{}' is written twice in this file", name));
      continue;
    }
    seen.push_back(name);
    const auto found = find_pass(base.passes, name);
    if (found == base.passes.end()) {
      if (text_of(pass.role).empty() || text_of(pass.technique).empty()) {
        const std::string missing = text_of(pass.role).empty() ? "role" : "technique";
        problems.add(pass.name.where,
                     fmt::format("there is no pass '{}' to change, and a new one needs a {}", name, missing),
                     "name = " + to_toml(pass.name), "one of " + join_names(names_of(base.passes)),
                     did_you_mean(name, names_of(base.passes)));
        continue;
      }
      place_pass(base.passes, std::move(pass), problems);
      continue;
    }
    const bool is_moved = pass.after || pass.before;
    const auto after = pass.after;
    const auto before = pass.before;
    merge_pass(*found, std::move(pass), problems);
    if (is_moved) {
      WrittenPass moved = std::move(*found);
      base.passes.erase(found);
      moved.after = after;
      moved.before = before;
      place_pass(base.passes, std::move(moved), problems);
    }
  }
  problems.throw_if_any();
  return base;
}

void apply_setting(WrittenGraph& graph, std::string_view setting, const fs::path& shipped) {
  apply_setting(graph, setting, 0, shipped);
}

}  // namespace heddle::graph
