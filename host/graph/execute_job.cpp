// SPDX-License-Identifier: Apache-2.0
// Jobs: what a graph leaves for later, found in the cache or made. A job runs in waves, each a plan of its own, so that
// an artifact is there before the passes that read it are declared; and jobs of other files come first.

#include "graph/execute_state.hpp"

#include "content_hash.hpp"
#include "graph/uses.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <set>

namespace heddle::graph {

namespace {

bool is_lasting_output(const ResolvedGraph& graph, ResourceIndex resource, PassIndex pass) {
  return lasts(graph.resources[resource].type) && graph.resources[resource].producer == pass;
}

template <typename T>
void add_record(ContentHash& hash, const T& record) {
  static_assert(std::is_trivially_copyable_v<T>);
  hash.add({reinterpret_cast<const char*>(&record), sizeof record});
}

/// Of everything in a scene that an input's job may depend on, but for where things are: what moves from frame to frame
/// makes no artifact anew.
std::string hash_without_places(const scene::Scene& scene) {
  ContentHash hash;
  add_record(hash, scene.content_revision);
  add_record(hash, scene.components.revision());
  for (const std::string& feature : scene.features()) hash.add(feature);
  if (scene.environment) add_record(hash, scene.environment->record);
  for (const scene::Light& light : scene.lights) {
    HeddleLight record = light.record;
    for (auto* place : {record.position_rel, record.direction, record.tangent}) std::fill_n(place, 3, 0.0F);
    add_record(hash, record);
    hash.add(light.name);
    add_record(hash, light.texture == nullptr ? std::uint64_t{0} : light.texture->revision);
  }
  return hash.hexadecimal();
}

/// Device and driver: numbers differ between them.
std::string device_text(const vulkan::Device& device) {
  const vulkan::DeviceInfo& info = device.info();
  return fmt::format("{}, {} {}", info.name, info.driver, info.driver_version);
}

}  // namespace

/// All that a run without names is to leave.
std::vector<std::string> Executor::State::job_wants() const {
  std::vector<std::string> names;
  for (const Resource& resource : original.resources)
    if (lasts(resource.type) && resource.producer != kNoIndex) names.push_back(resource.name);
  if (original.output != kNoIndex) names.push_back(original.resources[original.output].name);
  names.insert(names.end(), kept_names.begin(), kept_names.end());
  return names;
}

/// Check mode proves what code does, poison what it leaves out: both need it to run, and keep nothing of it. A job that
/// another graph names is not what is being proven there.
bool Executor::State::keeps_artifacts() const {
  return (!services.checks || is_named) && !variant.poison;
}

/// Artifacts of other jobs that passes read which a scene with these features calls for.
std::vector<ResourceIndex> Executor::State::needed_artifacts(const std::vector<std::string>& features) const {
  ResolvedGraph pruned = original;
  std::vector<ResourceIndex> asked;
  if (original.is_job)
    for (const std::string& name : job_wants()) asked.push_back(find_resource(pruned, name));
  else
    for (const std::string& name : frame_wants()) asked.push_back(find_resource(pruned, name));
  prune(pruned, asked, features);
  std::vector<ResourceIndex> needed;
  for (const Pass& pass : pruned.passes)
    for (const auto& [port, resource] : pass.ports)
      if (!pass.is_pruned && original.resources[resource].job != kNoIndex) needed.push_back(resource);
  std::ranges::sort(needed);
  needed.erase(std::unique(needed.begin(), needed.end()), needed.end());
  return needed;
}

/// What a frame is to show.
std::vector<std::string> Executor::State::frame_wants() const {
  std::vector<std::string> names{original.resources[original.output].name};
  names.insert(names.end(), kept_names.begin(), kept_names.end());
  return names;
}

/// What a pass may know of the frame: nothing that its key does not hold.
heddle_frame_info Executor::State::info_for(const Pass& pass) const {
  heddle_frame_info seen = info;
  if (!graph.is_job || sees_origin(graph, pass)) return seen;
  std::ranges::fill(seen.origin, 0.0);
  std::ranges::fill(seen.previous_origin, 0.0);
  return seen;
}

/// A file that a parameter of the pass names is part of its key.
bool Executor::State::is_key_file(const Pass& pass, std::string_view path) const {
  return std::ranges::any_of(pass.parameters, [&](const ParameterValue& value) {
    return std::ranges::find(value.names, path) != value.names.end();
  });
}

/// Runs the jobs whose artifacts this scene calls for, as it is posed. True if one is another than before.
bool Executor::State::run_jobs(const scene::Scene& rendered) {
  if (original.jobs.empty()) return false;
  std::string now = hash_without_places(rendered);
  if (now == jobs_scene) return false;
  jobs.resize(original.jobs.size());
  const std::vector<ResourceIndex> needed = needed_artifacts(rendered.features());
  bool is_another = false;
  for (std::uint32_t j = 0; j < original.jobs.size(); ++j) {
    std::vector<std::string> names;
    for (const ResourceIndex resource : needed)
      if (original.resources[resource].job == j) names.push_back(original.resources[resource].job_resource);
    if (names.empty()) continue;
    if (!jobs[j]) {
      jobs[j] = std::make_unique<Executor>(services, *original.jobs[j].graph);
      jobs[j]->state_->is_named = true;
    }
    const JobResult& result = jobs[j]->run_job(rendered, {}, names);
    for (const ResourceIndex index : needed) {
      const Resource& resource = original.resources[index];
      if (resource.job != j) continue;
      const Lasting& made = result.parts.at(resource.job_resource);
      const auto known = lasting.find(resource.name);
      is_another = is_another || known == lasting.end() || known->second.key != made.key;
      lasting.insert_or_assign(resource.name, made);
      const ArtifactUse use{
          made.pass, {}, made.key, made.file, made.bytes->size(), made.is_reused, original.jobs[j].file, made.port};
      std::erase_if(stats.artifacts, [&](const ArtifactUse& other) {
        return other.job == use.job && other.pass == use.pass && other.port == use.port;
      });
      stats.artifacts.push_back(use);
    }
  }
  jobs_scene = std::move(now);
  return is_another;
}

/// For a graph that replaced one with the jobs `former`: they are due, and those that both name keep what they made.
void Executor::State::adopt_jobs(const std::vector<GraphJob>& former) {
  std::vector<std::unique_ptr<Executor>> adopted(original.jobs.size());
  for (std::size_t j = 0; j < jobs.size() && j < former.size(); ++j) {
    const auto same = std::ranges::find(original.jobs, former[j].file, &GraphJob::file);
    if (same == original.jobs.end() || !jobs[j]) continue;
    jobs[j]->replace(*same->graph, {});
    adopted[static_cast<std::size_t>(same - original.jobs.begin())] = std::move(jobs[j]);
  }
  jobs = std::move(adopted);
  jobs_scene.clear();
}

bool Executor::State::has_lasting(PassIndex pass) const {
  for (const auto& [port, resource] : original.passes[pass].ports) {
    if (!is_lasting_output(original, resource, pass)) continue;
    const auto known = lasting.find(original.resources[resource].name);
    if (known == lasting.end() || known->second.key != pass_keys[pass]) return false;
  }
  return true;
}

/// Takes what a pass leaves from the cache. False where that does not have all of it.
bool Executor::State::find_lasting(PassIndex index) {
  if (has_lasting(index)) return true;
  if (services.remakes_artifacts || !keeps_artifacts()) return false;
  if (!looked_up.insert(pass_keys[index]).second) return false;
  const Pass& pass = original.passes[index];
  std::string damage;
  std::optional<ArtifactParts> parts = services.artifacts.read(pass_keys[index], damage);
  const std::string file = services.artifacts.file(pass_keys[index]).string();
  std::map<std::string, Lasting, std::less<>> found;
  for (const auto& [port, resource] : pass.ports) {
    if (!parts || !is_lasting_output(original, resource, index)) continue;
    const auto part = parts->find(port);
    if (part == parts->end()) {
      damage = "it lacks a part";
      break;
    }
    Lasting one{pass.name,
                port,
                pass_keys[index],
                file,
                original.resources[resource].type,
                std::make_shared<const std::vector<std::byte>>(std::move(part->second)),
                true};
    if (const auto store = parts->find(port + std::string(kStorePart)); store != parts->end()) {
      one.store = std::make_shared<StorePlace>(services.artifacts.store(pass_keys[index], port), store->second);
      damage = one.store->damage();
      if (!damage.empty()) break;
    }
    found[original.resources[resource].name] = std::move(one);
  }
  if (!damage.empty()) warn(pass, fmt::format("the artifact {} is damaged: {}; it is made again", file, damage));
  if (!parts || !damage.empty()) return false;
  for (auto& [name, one] : found) lasting.insert_or_assign(name, std::move(one));
  return true;
}

/// Passes that have to run for these resources because what they leave is nowhere, or because images are asked for,
/// which nobody keeps.
std::vector<PassIndex> Executor::State::find_due(const std::vector<std::string>& names) {
  std::set<PassIndex> due, seen;
  const std::function<void(PassIndex, bool)> visit = [&](PassIndex index, bool is_asked_for_images) {
    if (index == kNoIndex || !seen.insert(index).second) return;
    const Pass& pass = original.passes[index];
    if (makes_what_lasts(*pass.entry.technique)) {
      if (find_lasting(index) && !is_asked_for_images) return;
      if (!has_lasting(index)) due.insert(index);
    }
    for (const PassIndex before : pass.dependencies) visit(before, false);
  };
  // Passes of images first: they run whatever the cache holds.
  for (const bool is_image : {true, false})
    for (const std::string& name : names) {
      const Resource& resource = original.resources[find_resource(original, name)];
      if (lasts(resource.type) != is_image) visit(resource.producer, is_image);
    }
  return {due.begin(), due.end()};
}

/// Those of them that wait for no other.
std::vector<PassIndex> Executor::State::find_ready(const std::vector<PassIndex>& due) const {
  std::vector<PassIndex> ready;
  for (const PassIndex index : due) {
    std::set<PassIndex> reached;
    const std::function<void(PassIndex)> visit = [&](PassIndex at) {
      for (const PassIndex before : original.passes[at].dependencies) {
        const bool is_there = makes_what_lasts(*original.passes[before].entry.technique) && has_lasting(before);
        if (!is_there && reached.insert(before).second) visit(before);
      }
    };
    visit(index);
    if (std::ranges::none_of(due, [&](PassIndex other) { return other != index && reached.contains(other); }))
      ready.push_back(index);
  }
  return ready;
}

void Executor::State::run_job(const scene::Scene& rendered, const FrameOptions& options,
                              const std::vector<std::string>& names) {
  (void)run_jobs(rendered);
  const std::array<glm::dvec3, 2> bounds = rendered.bounds();
  origin = previous_origin = 0.5 * (bounds[0] + bounds[1]);
  KeyContext context{services.registry, rendered, origin, options.time, options.seed, {}, {}};
  context.device = [&] {
    open_device();
    return device_text(*device);
  };
  context.artifact = [&](const Resource& resource) {
    const auto known = lasting.find(resource.name);
    return known == lasting.end() ? std::string{} : known->second.key;  // none: nothing that is wanted reads it
  };
  pass_keys = artifact_keys(original, context);
  pass_codes = code_keys(original, context);
  piece_packs.clear();
  looked_up.clear();
  if (services.remakes_artifacts || !keeps_artifacts())
    // Those of other jobs stay; what another graph left under a name that this one lacks goes with the rest.
    std::erase_if(lasting, [&](const auto& one) {
      return std::ranges::none_of(original.resources, [&](const Resource& resource) {
        return resource.name == one.first && resource.job != kNoIndex;
      });
    });

  const std::vector<std::string> asked = names.empty() ? job_wants() : names;
  std::vector<std::string> images;
  for (const std::string& name : asked)
    if (!lasts(original.resources[find_resource(original, name)].type)) images.push_back(name);
  const std::vector<std::string> features = rendered.features();
  for (bool are_images_due = !images.empty();;) {
    const std::vector<PassIndex> due = find_due(asked);
    if (due.empty() && !are_images_due) break;
    for (const PassIndex index : due) {
      const Pass& pass = original.passes[index];
      for (const std::string& feature : pass.entry.technique->features)
        if (std::ranges::find(features, feature) == features.end())
          throw Error(
              HEDDLE_BAD_INPUT,
              Diagnostic{Severity::kError,
                         pass.where,
                         fmt::format("pass '{}' has nothing to work on: the scene has no '{}'", pass.name, feature),
                         {},
                         fmt::format("a scene with '{}'", feature),
                         {}});
    }
    const std::vector<PassIndex> ready = find_ready(due);
    wave.clear();
    for (const PassIndex index : ready)
      for (const auto& [port, resource] : original.passes[index].ports)
        if (is_lasting_output(original, resource, index)) wave.push_back(original.resources[resource].name);
    if (ready.size() == due.size()) {
      wave.insert(wave.end(), images.begin(), images.end());
      are_images_due = false;
    }
    unplan();
    forget_frames();
    planned_scene = &rendered;
    plan(rendered);
    planned_scene = nullptr;
    run_frame(rendered, options);
    for (const PassIndex index : ready)
      if (!has_lasting(index))
        throw Error(HEDDLE_BUG, fmt::format("pass '{}' ran, and left nothing", original.passes[index].name));
  }
  job_result.parts.clear();
  for (const std::string& name : asked)
    if (const auto made = lasting.find(name); made != lasting.end()) job_result.parts.insert(*made);
}

const JobResult& Executor::run_job(const scene::Scene& scene, const FrameOptions& options,
                                   const std::vector<std::string>& names) {
  State& s = *state_;
  const auto start = std::chrono::steady_clock::now();
  try {
    s.errors.clear();
    s.stop_if_cancelled();
    s.run_job(scene, options, names);
    s.stop_if_cancelled();
  } catch (...) {
    s.planned_scene = nullptr;
    s.commands = VK_NULL_HANDLE;
    s.unplan();
    throw;
  }
  s.job_result.wall_ms = std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return s.job_result;
}

const JobResult& Executor::job_result() const {
  return state_->job_result;
}

/// Into a plan: artifacts that are there are nobody's work any more. Passes that run for their images make theirs
/// again.
void Executor::State::place_lasting() {
  std::set<PassIndex> running;
  for (const ResourceIndex resource : wanted) running.insert(graph.resources[resource].producer);
  for (ResourceIndex i = 0; i < graph.resources.size(); ++i) {
    Resource& resource = graph.resources[i];
    const auto known = lasting.find(resource.name);
    if (!lasts(resource.type) || known == lasting.end() ||
        (resource.producer != kNoIndex && running.contains(resource.producer)))
      continue;
    resource.producer = kNoIndex;
    resource.byte_size = known->second.bytes->size();
    resource.content = known->second.key;
    set_value(i, *known->second.bytes);
  }
}

/// After a pass's last stage: what it leaves is complete.
void Executor::State::keep_lasting(std::uint32_t index) {
  const PassIndex p = order.stages[index].pass;
  const Pass& pass = graph.passes[p];
  if (!graph.is_job || !is_last_iteration || passes[p]->again || !makes_what_lasts(*pass.entry.technique)) return;
  for (std::uint32_t s = index + 1; s < order.stages.size(); ++s)
    if (order.stages[s].pass == p) return;
  ArtifactViews parts;
  for (const auto& [port, resource] : pass.ports)
    if (is_lasting_output(graph, resource, p)) parts[port] = resources[resource].value.bytes;
  std::deque<std::uint64_t> sizes;
  const auto stores = keep_stores(p, parts, sizes);
  std::string file;
  if (keeps_artifacts()) {
    keep_pieces(p);
    const std::string problem = services.artifacts.write(pass_keys[p], parts);
    if (!problem.empty())
      warn(pass, problem + "; it will be made again next time");
    else if (services.artifacts.keeps_anything())
      file = services.artifacts.file(pass_keys[p]).string();
  }
  for (const auto& [port, bytes] : parts) {
    if (!pass.ports.contains(port)) continue;
    const auto store = stores.find(port);
    const Resource& resource = graph.resources[pass.ports.at(port)];
    lasting.insert_or_assign(resource.name,
                             Lasting{pass.name, port, pass_keys[p], file, resource.type,
                                     std::make_shared<const std::vector<std::byte>>(bytes.begin(), bytes.end()), false,
                                     store == stores.end() ? nullptr : store->second});
  }
}

}  // namespace heddle::graph
