// SPDX-License-Identifier: Apache-2.0
// heddle new-technique ROLE NAME: the role's contract -> <folder>/ROLE/NAME, whole or not at all.
#include "cli/new_technique.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <fstream>

#include "cli/session.hpp"
#include "cli/technique_template.hpp"
#include "json.hpp"

namespace heddle::cli {
namespace {

namespace fs = std::filesystem;
struct Arguments {
  HostArguments host;
  std::string role, name;
  std::string folder = "plugins";
  std::string language = "c++";
};

// Names of techniques are folders, words of graphs and parts of C++ and GLSL names.
bool is_technique_name(std::string_view name) {
  const bool has_good_start = !name.empty() && name.front() >= 'a' && name.front() <= 'z';
  return has_good_start && name != "none" && name.find("__") == std::string_view::npos &&
         name.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_") == std::string_view::npos;
}

const Json& find_role(const Json& list, const std::string& name) {
  std::vector<std::string> names;
  for (const Json& role : list["roles"]) {
    if (role["name"] == name) return role;
    names.push_back(role["name"].get<std::string>());
  }
  throw Failure{HEDDLE_BAD_INPUT, fmt::format("error: there is no role '{}'\n  expected: one of {}\n"
                                              "  help:     a new role begins with a role.toml in a folder of its own",
                                              name, fmt::join(names, ", "))};
}

void write_folder(const fs::path& folder, const std::vector<TemplateFile>& files) {
  std::error_code error;
  if (fs::exists(folder)) {
    throw Failure{
        HEDDLE_BAD_INPUT,
        fmt::format("{}: error: this folder exists already\n  help:     choose another name", folder.string())};
  }
  fs::path unfinished = folder;
  unfinished += ".new";
  fs::remove_all(unfinished, error);
  fs::create_directories(unfinished, error);
  if (!error) {
    for (const TemplateFile& file : files) write_file(unfinished / file.name, file.text);
    fs::rename(unfinished, folder, error);
  }
  if (error) {
    throw Failure{HEDDLE_FAILED,
                  fmt::format("{}: error: cannot make this folder\n  found:    {}", folder.string(), error.message())};
  }
}

/// Outside of Heddle's own tree, and in a folder that nothing builds yet: the project that builds it. True if it was
/// made.
bool write_project(const fs::path& folder) {
  const fs::path absolute = fs::absolute(folder).lexically_normal();
  const fs::path name = absolute.has_filename() ? absolute.filename() : absolute.parent_path().filename();
  const fs::path parent = absolute.has_filename() ? absolute.parent_path() : absolute.parent_path().parent_path();
  const fs::path file = parent / "CMakeLists.txt";
  if (fs::exists(absolute / "CMakeLists.txt") || fs::exists(file)) return false;
  write_file(file,
             fmt::format("# cmake -B build -DCMAKE_PREFIX_PATH=<where Heddle is installed> && cmake --build build,\n"
                         "# then HEDDLE_PLUGIN_PATH=build/plugins heddle list\n"
                         "cmake_minimum_required(VERSION 3.25)\n"
                         "project(techniques LANGUAGES C CXX)\n"
                         "if(NOT CMAKE_BUILD_TYPE)\n  set(CMAKE_BUILD_TYPE Release)\nendif()\n"
                         "find_package(heddle {} REQUIRED)\n"
                         "heddle_plugin_folder({})\n",
                         heddle_version(), name.string()));
  fmt::print("{}\n", file.string());
  return true;
}

void run(const Arguments& arguments) {
  if (!is_technique_name(arguments.name)) {
    throw Failure{HEDDLE_BAD_INPUT,
                  fmt::format("error: '{}' is no name for a technique\n"
                              "  expected: small letters, digits and single underscores, a letter first; not 'none'",
                              arguments.name)};
  }
  const Owned<heddle_host> host = make_host(arguments.host);
  const char* text = nullptr;
  check(host.get(), heddle_list(host.get(), &text));
  const Json list = parse_json(text);
  const auto files = technique_template(find_role(list, arguments.role), arguments.name,
                                        arguments.language == "c" ? TemplateLanguage::kC : TemplateLanguage::kCpp);
  const fs::path folder = fs::path(arguments.folder) / arguments.role / arguments.name;
  write_folder(folder, files);
  fmt::print("{}\n", folder.string());
  for (const TemplateFile& file : files) fmt::print("  {}\n", file.name);
  const bool is_outside = write_project(arguments.folder);
  say(arguments.host, is_outside ? "the first lines of CMakeLists.txt say how to build it and have it in `heddle list`"
                                 : "build again to have it in `heddle list`");
}

}  // namespace

void add_new_technique(CLI::App& app) {
  CLI::App* command = app.add_subcommand("new-technique", "a folder with a technique that builds and loads at once");
  auto arguments = std::make_shared<Arguments>();
  arguments->host.add_to(*command);
  command->add_option("role", arguments->role, "the job, as `heddle list` names it")->required();
  command->add_option("name", arguments->name, "the technique's name")->required();
  command->add_option("--folder", arguments->folder, "where ROLE/NAME is made")->capture_default_str();
  command->add_option("--language", arguments->language, "of pass.cpp or pass.c")
      ->check(CLI::IsMember({"c", "c++"}))
      ->capture_default_str();
  command->callback([arguments] { run(*arguments); });
}

}  // namespace heddle::cli
