// SPDX-License-Identifier: Apache-2.0
// What `heddle run` does with a graph that is a job.
#pragma once

#include "cli/outputs.hpp"
#include "cli/session.hpp"

namespace heddle::cli {

struct JobArguments {
  const RenderArguments& render;
  std::vector<Output> outputs;
  std::string stats;  // file; "-": standard output; empty: none
  bool is_profiled = false;
};

/// Keeps the image that an output names. What is no port of the graph may be a file's name: the failure then says how
/// to write that.
void keep_output(heddle_host* host, heddle_graph* graph, const Output& output);
/// True where the graph says kind = "job".
bool is_job(heddle_host* host, heddle_graph* graph);
/// Makes what the job leaves, unless the cache holds it, writes the outputs, and prints reports. Answers the exit
/// status: 1 if a report has an error. Throws Failure.
int run_job(heddle_host* host, heddle_graph* job, heddle_scene* scene, const JobArguments& arguments);
/// What is wrong with the arguments for a job, and images that it has to keep; before the scene is loaded.
void prepare_job(heddle_host* host, heddle_graph* job, const JobArguments& arguments);

}  // namespace heddle::cli
