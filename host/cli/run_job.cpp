// SPDX-License-Identifier: Apache-2.0
#include "cli/run_job.hpp"

#include "cli/stop.hpp"
#include "json.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace heddle::cli {

namespace {

constexpr double kMebibyte = 1048576.0;

Json describe(heddle_host* host, heddle_graph* graph) {
  const char* text = nullptr;
  check(host, heddle_graph_describe(graph, &text));
  return parse_json(text);
}

/// The type of a port of the job; empty: there is none of that name.
std::string type_of(const Json& description, const std::string& port) {
  for (const Json& one : description["ports"])
    if (one["name"] == port) return one["type"].get<std::string>();
  return {};
}

/// What an output without a port means: the job's output, else the one thing that it leaves.
std::string meant_port(const Json& description, const std::string& port) {
  if (!port.empty()) return port;
  if (!description["output"].is_null()) return description["output"].get<std::string>();
  std::vector<std::string> names;
  for (const Json& one : description["ports"]) {
    const auto name = one["name"].get<std::string>();
    const bool is_own = name.find('#') == std::string::npos;
    if (is_own && (one["type"] == "artifact" || one["type"] == "report")) names.push_back(name);
  }
  if (names.size() != 1)
    throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: the job leaves {} things, and --output names none of them\n"
                                                "  expected: PASS.PORT=FILE with one of {}",
                                                names.size(), fmt::join(names, ", "))};
  return names.front();
}

const Json* find_named(const Json& list, const std::string& name) {
  const auto found = std::ranges::find_if(list, [&](const Json& one) { return one["name"] == name; });
  return found == list.end() ? nullptr : &*found;
}

void write_output(heddle_host* host, heddle_graph* job, const Json& result, const std::string& port,
                  const std::filesystem::path& file) {
  if (file.has_parent_path()) {
    std::error_code ignored;
    std::filesystem::create_directories(file.parent_path(), ignored);
  }
  if (const Json* report = find_named(result["reports"], port); report != nullptr) {
    write_file(file, write_json((*report)["rows"], 2) + "\n");
  } else if (find_named(result["artifacts"], port) != nullptr) {
    const void* data = nullptr;
    std::uint64_t bytes = 0;
    check(host, heddle_job_artifact(job, port.c_str(), &data, &bytes));
    write_file(file, {static_cast<const char*>(data), bytes});
  } else {
    write_port(host, job, port, file);
  }
}

std::string value_text(const Json& value) {
  return value.is_string() ? value.get<std::string>() : write_json(value);
}

void print_report(const Json& report) {
  for (const Json& row : report["rows"]) {
    std::string values;
    for (const auto& [name, value] : row["values"].items())
      values += fmt::format("{}{} {}", values.empty() ? "" : ", ", name, value_text(value));
    fmt::print("{}: {}: {}{}\n", report["name"].get<std::string>(), row["level"].get<std::string>(),
               row["message"].get<std::string>(), values.empty() ? "" : " (" + values + ")");
  }
}

}  // namespace

bool is_job(heddle_host* host, heddle_graph* graph) {
  return describe(host, graph)["kind"] == "job";
}

void keep_output(heddle_host* host, heddle_graph* graph, const Output& output) {
  refuse_format(output);
  const auto& [port, file] = output;
  if (port.empty()) return;
  try {
    check(host, heddle_graph_keep(graph, port.c_str()));
  } catch (Failure& failure) {
    failure.message +=
        fmt::format("\n  help:     if '{0}={1}' is a file, write --output './{0}={1}'", port, file.string());
    throw;
  }
}

void prepare_job(heddle_host* host, heddle_graph* job, const JobArguments& arguments) {
  if (arguments.render.frames != 1 || arguments.is_profiled)
    throw Failure{HEDDLE_BAD_INPUT,
                  fmt::format("error: {} is for graphs of frames, and '{}' is a job: it runs once",
                              arguments.is_profiled ? "--profile" : "--frames", arguments.render.graph_file.string())};
  const Json description = describe(host, job);
  for (const Output& output : arguments.outputs) {
    const std::string port = meant_port(description, output.port);
    const std::string type = type_of(description, port);
    // Images are in no cache; what is no port at all, this says.
    if (type != "artifact" && type != "report") keep_output(host, job, {port, output.file});
  }
}

int run_job(heddle_host* host, heddle_graph* job, heddle_scene* scene, const JobArguments& arguments) {
  heddle_render_options options{};
  options.struct_size = sizeof options;
  options.time = arguments.render.time;
  options.seed = arguments.render.seed;
  const char* text = nullptr;
  check(host, heddle_job_run(job, scene, &options, &text));
  const Json result = parse_json(text);
  const Json description = describe(host, job);
  Writing writing;
  for (const Output& output : arguments.outputs) {
    stop_if_asked();
    writing.write([&] {
      write_output(host, job, result, meant_port(description, output.port), output.file);
      say(arguments.render.host, fmt::format("wrote {}", output.file.string()));
    });
  }
  for (const Json& report : result["reports"]) print_report(report);
  if (arguments.stats == "-") {
    fmt::print("{}\n", write_json(result, 2));
  } else if (!arguments.stats.empty()) {
    write_file(arguments.stats, write_json(result, 2) + "\n");
  }
  for (const Json& artifact : result["artifacts"]) {
    const auto file = artifact["file"].get<std::string>();
    say(arguments.render.host,
        fmt::format("artifact '{}': {}, {:.1f} MiB{}", artifact["name"].get<std::string>(),
                    artifact["origin"] == "cache" ? "from the cache" : "made",
                    (artifact["bytes"].get<double>() + artifact.value("store_bytes", 0.0)) / kMebibyte,
                    file.empty() ? ", kept nowhere" : ", " + file));
  }
  const auto errors = result["errors"].get<std::size_t>();
  say(arguments.render.host,
      fmt::format("{}: {:.1f} s{}", arguments.render.graph_file.string(), result["wall_ms"].get<double>() / 1000.0,
                  errors == 0 ? "" : fmt::format(", {} errors were reported", errors)));
  writing.finish();
  return errors == 0 ? HEDDLE_OK : 1;
}

}  // namespace heddle::cli
