// SPDX-License-Identifier: Apache-2.0
// The walk over the words: pointers and handles are followed from variables through chains, copies and calls to the
// instructions that touch memory. A function is summed up once, as effects on its parameters and on variables.
#include "vulkan/shader_access.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>

#include <spirv_cross/spirv.hpp>

namespace heddle::vulkan::shader {
namespace {

using Id = std::uint32_t;

enum Effect : std::uint8_t {
  kRead = 1,
  kWrite = 2,
  kReadImage = 4,  // OpImageRead, beside kRead
  kAtomic = 8,     // beside both, by an atomic operation; kPlain: by any other
  kPlain = 16,
};

struct Instruction {
  spv::Op operation = spv::OpNop;
  std::span<const std::uint32_t> operands;
};

struct FunctionWords {
  std::vector<Id> parameters;
  std::vector<Instruction> body;
};

struct Module {
  Id entry = 0;
  std::map<Id, std::string> names;
  std::map<Id, std::uint32_t> sets, bindings;
  std::map<Id, Id> pointees;  // pointer type -> what it points to; array type -> element
  std::set<Id> runtime_arrays;
  std::set<Id> handle_types;  // images, samplers, and both combined
  std::set<Id> images_without_format;
  std::map<Id, std::uint32_t> strides;                            // of array types
  std::map<Id, std::vector<Id>> members;                          // of structures
  std::map<std::pair<Id, std::uint32_t>, std::uint32_t> offsets;  // of a structure's member
  std::vector<std::pair<Id, Id>> variables;                       // id, type; those outside of functions
  std::map<Id, FunctionWords> functions;
};

// Characters are packed four a word, the first lowest, until a zero.
std::string text_of(std::span<const std::uint32_t> words) {
  std::string text;
  for (std::size_t i = 0; i < 4 * words.size(); ++i) {
    const auto c = static_cast<char>((words[i / 4] >> (8 * (i % 4))) & 0xffU);
    if (c == '\0') break;
    text += c;
  }
  return text;
}

/// How many operands an instruction must have for read_module to look at it.
std::size_t least_operands(spv::Op operation) {
  switch (operation) {
    case spv::OpName:
    case spv::OpTypeRuntimeArray:
    case spv::OpFunctionParameter:
    case spv::OpTypeSampledImage:
    case spv::OpEntryPoint:
    case spv::OpFunction:
      return 2;
    case spv::OpTypeSampler:
    case spv::OpTypeStruct:
      return 1;
    case spv::OpDecorate:
    case spv::OpMemberDecorate:
    case spv::OpTypePointer:
    case spv::OpTypeArray:
    case spv::OpVariable:
      return 3;
    case spv::OpTypeImage:
      return 8;
    default:
      return 0;
  }
}

void read_instruction(Module& module, FunctionWords*& current, const Instruction& instruction) {
  const auto& [operation, operands] = instruction;
  if (operands.size() < least_operands(operation)) return;
  switch (operation) {
    case spv::OpEntryPoint:
      module.entry = operands[1];
      break;
    case spv::OpName:
      module.names[operands[0]] = text_of(operands.subspan(1));
      break;
    case spv::OpDecorate:
      if (operands[1] == spv::DecorationDescriptorSet) module.sets[operands[0]] = operands[2];
      if (operands[1] == spv::DecorationBinding) module.bindings[operands[0]] = operands[2];
      if (operands[1] == spv::DecorationArrayStride) module.strides[operands[0]] = operands[2];
      break;
    case spv::OpMemberDecorate:
      if (operands[2] == spv::DecorationOffset && operands.size() > 3)
        module.offsets[{operands[0], operands[1]}] = operands[3];
      break;
    case spv::OpTypeStruct:
      module.members[operands[0]].assign(operands.begin() + 1, operands.end());
      break;
    case spv::OpTypeImage: {
      constexpr std::size_t kSampled = 6, kFormat = 7;
      constexpr std::uint32_t kStorage = 2;
      module.handle_types.insert(operands[0]);
      if (operands[kSampled] == kStorage && operands[kFormat] == spv::ImageFormatUnknown)
        module.images_without_format.insert(operands[0]);
      break;
    }
    case spv::OpTypeSampler:
    case spv::OpTypeSampledImage:
      module.handle_types.insert(operands[0]);
      break;
    case spv::OpTypePointer:
      module.pointees[operands[0]] = operands[2];
      break;
    case spv::OpTypeRuntimeArray:
      module.runtime_arrays.insert(operands[0]);
      module.pointees[operands[0]] = operands[1];
      break;
    case spv::OpTypeArray:
      module.pointees[operands[0]] = operands[1];
      break;
    case spv::OpVariable:
      if (current == nullptr) module.variables.emplace_back(operands[1], operands[0]);
      break;
    case spv::OpFunction:
      current = &module.functions[operands[1]];
      return;
    case spv::OpFunctionParameter:
      if (current != nullptr) current->parameters.push_back(operands[1]);
      return;
    case spv::OpFunctionEnd:
      current = nullptr;
      return;
    default:
      break;
  }
  if (current != nullptr) current->body.push_back(instruction);
}

Module read_module(std::span<const std::uint32_t> words) {
  constexpr std::size_t kHeaderWords = 5;
  Module module;
  FunctionWords* current = nullptr;
  for (std::size_t at = kHeaderWords; at < words.size();) {
    const std::uint32_t count = words[at] >> 16U;
    if (count == 0 || at + count > words.size()) break;
    read_instruction(module, current, {static_cast<spv::Op>(words[at] & 0xffffU), words.subspan(at + 1, count - 1)});
    at += count;
  }
  return module;
}

/// Instructions that make a pointer or handle from another one: [type, result, then those listed here].
struct Derivation {
  std::size_t first = 0, count = 0, step = 1;  // operands that are followed
};
std::optional<Derivation> derivation(const Instruction& instruction) {
  constexpr std::size_t kAll = ~std::size_t{0};
  switch (instruction.operation) {
    case spv::OpAccessChain:
    case spv::OpInBoundsAccessChain:
    case spv::OpPtrAccessChain:
    case spv::OpInBoundsPtrAccessChain:
    case spv::OpImageTexelPointer:
    case spv::OpCopyObject:
    case spv::OpCopyLogical:
    case spv::OpImage:
      return Derivation{2, 1};
    case spv::OpSampledImage:
      return Derivation{2, 2};
    case spv::OpSelect:
      return Derivation{3, 2};
    case spv::OpPhi:  // pairs of value and block
      return Derivation{2, kAll, 2};
    default:
      return std::nullopt;
  }
}

bool is_image_read(spv::Op operation) {
  return (operation >= spv::OpImageSampleImplicitLod && operation <= spv::OpImageRead) ||
         (operation >= spv::OpImageSparseSampleImplicitLod && operation <= spv::OpImageSparseDrefGather) ||
         operation == spv::OpImageSparseRead;
}
bool is_atomic(spv::Op operation) {
  return (operation >= spv::OpAtomicLoad && operation <= spv::OpAtomicXor) ||
         operation == spv::OpAtomicFlagTestAndSet || operation == spv::OpAtomicFlagClear ||
         operation == spv::OpAtomicFAddEXT || operation == spv::OpAtomicFMinEXT || operation == spv::OpAtomicFMaxEXT;
}

using Effects = std::map<Id, std::uint8_t>;  // by parameter or variable

class Walk {
 public:
  explicit Walk(const Module& module) : module_(module) {
    for (const auto& [id, type] : module.variables) variables_.insert(id);
  }

  /// Effects of calling a function, its own callees included.
  const Effects& effects_of(Id id) {
    const auto known = effects_.find(id);
    if (known != effects_.end()) return known->second;
    Effects& effects = effects_[id];  // shaders do not recurse; a hostile module that does ends here
    const auto function = module_.functions.find(id);
    if (function == module_.functions.end()) return effects;
    const std::map<Id, std::set<Id>> roots = follow(function->second);
    Effects found;
    for (const Instruction& instruction : function->second.body) {
      touch(instruction, [&](Id pointer, std::uint8_t effect) {
        const auto at = roots.find(pointer);
        if (at == roots.end()) return;
        for (const Id root : at->second) found[root] |= effect;
      });
    }
    return effects_[id] = std::move(found);
  }

 private:
  /// Every pointer and handle of a function, and the parameters and variables that it may stem from.
  [[nodiscard]] std::map<Id, std::set<Id>> follow(const FunctionWords& function) const {
    std::map<Id, std::set<Id>> roots;
    for (const Id variable : variables_) roots[variable] = {variable};
    for (const Id parameter : function.parameters) roots[parameter] = {parameter};
    // Once is enough, but for OpPhi: what a loop hands back is defined below.
    for (bool is_new = true; is_new;) {
      is_new = false;
      for (const Instruction& instruction : function.body) {
        const auto& operands = instruction.operands;
        if (operands.size() < 3) continue;
        Derivation from{2, 1};
        if (const auto derived = derivation(instruction)) {
          from = *derived;
        } else if (instruction.operation != spv::OpLoad || !module_.handle_types.contains(operands[0])) {
          continue;
        }
        for (std::size_t i = 0; i < from.count && from.first + i * from.step < operands.size(); ++i) {
          const auto source = roots.find(operands[from.first + i * from.step]);
          if (source == roots.end()) continue;
          const std::set<Id> more = source->second;
          std::set<Id>& target = roots[operands[1]];
          const std::size_t before = target.size();
          target.insert(more.begin(), more.end());
          is_new = is_new || (target.size() != before && instruction.operation == spv::OpPhi);
        }
      }
    }
    return roots;
  }

  /// Tells `say` of every operand through which an instruction touches memory.
  template <typename Say>
  void touch(const Instruction& instruction, const Say& say) {
    const auto operation = instruction.operation;
    const auto& operands = instruction.operands;
    const int way = is_atomic(operation) ? kAtomic : kPlain;
    const auto tell = [&](std::size_t operand, int effect) {
      if (operand < operands.size()) say(operands[operand], static_cast<std::uint8_t>(effect | way));
    };
    if (operation == spv::OpLoad) {
      if (!operands.empty() && !module_.handle_types.contains(operands[0])) tell(2, kRead);
    } else if (operation == spv::OpStore || operation == spv::OpImageWrite || operation == spv::OpAtomicStore ||
               operation == spv::OpAtomicFlagClear) {
      tell(0, kWrite);
    } else if (operation == spv::OpCopyMemory || operation == spv::OpCopyMemorySized) {
      tell(0, kWrite);
      tell(1, kRead);
    } else if (operation == spv::OpAtomicLoad) {
      tell(2, kRead);
    } else if (is_atomic(operation)) {
      tell(2, kRead | kWrite);
    } else if (operation == spv::OpImageRead || operation == spv::OpImageSparseRead) {
      tell(2, kRead | kReadImage);
    } else if (is_image_read(operation)) {
      tell(2, kRead);
    } else if (operation == spv::OpFunctionCall) {
      call(operands, say);
    } else if (operation == spv::OpExtInst) {
      // modf and frexp write through their second argument; which set the numbers belong to does not matter.
      constexpr std::size_t kFirstArgument = 4;
      for (std::size_t i = kFirstArgument; i < operands.size(); ++i) tell(i, kRead | kWrite);
    } else if (operation == spv::OpReturnValue) {
      tell(0, kRead | kWrite);
    } else if (is_vendor(operation)) {
      for (std::size_t i = 0; i < operands.size(); ++i) tell(i, kRead | kWrite);
    } else if (operation == spv::OpConvertPtrToU || operation == spv::OpBitcast) {
      tell(2, kRead | kWrite);  // the address may go anywhere
    }
  }

  template <typename Say>
  void call(std::span<const std::uint32_t> operands, const Say& say) {
    constexpr std::size_t kFunction = 2, kFirstArgument = 3;
    if (operands.size() <= kFunction) return;
    const auto function = module_.functions.find(operands[kFunction]);
    if (function == module_.functions.end()) return;
    const std::vector<Id>& parameters = function->second.parameters;
    const Effects effects = effects_of(operands[kFunction]);
    for (const auto& [root, effect] : effects) {
      const auto parameter = std::find(parameters.begin(), parameters.end(), root);
      if (parameter == parameters.end()) {
        say(root, effect);
        continue;
      }
      const std::size_t argument = kFirstArgument + static_cast<std::size_t>(parameter - parameters.begin());
      if (argument < operands.size()) say(operands[argument], effect);
    }
  }

  /// Numbers from here on belong to extensions; the atomics among them are known.
  static bool is_vendor(spv::Op operation) {
    constexpr std::uint32_t kFirst = 4096;
    return operation >= static_cast<spv::Op>(kFirst) && !is_atomic(operation);
  }

  const Module& module_;
  std::set<Id> variables_;
  std::map<Id, Effects> effects_;
};

/// What a pointer type leads to, through arrays.
Id innermost(const Module& module, Id type) {
  for (auto found = module.pointees.find(type); found != module.pointees.end(); found = module.pointees.find(type))
    type = found->second;
  return type;
}

std::string name_of(const Module& module, Id id) {
  const auto found = module.names.find(id);
  return found == module.names.end() ? "" : found->second;
}

}  // namespace

std::vector<BoundVariable> find_accesses(std::span<const std::uint32_t> words) {
  const Module module = read_module(words);
  Walk walk(module);
  const Effects effects = walk.effects_of(module.entry);
  std::vector<BoundVariable> found;
  for (const auto& [id, type] : module.variables) {
    const auto set = module.sets.find(id);
    const auto binding = module.bindings.find(id);
    if (set == module.sets.end() || binding == module.bindings.end()) continue;
    const Id inner = innermost(module, type);
    BoundVariable variable{set->second, binding->second, name_of(module, id)};
    if (variable.name.empty()) variable.name = name_of(module, inner);
    if (const auto block = module.members.find(inner); block != module.members.end() && !block->second.empty()) {
      const auto last = static_cast<std::uint32_t>(block->second.size() - 1);
      const auto stride = module.strides.find(block->second[last]);
      const auto offset = module.offsets.find({inner, last});
      if (module.runtime_arrays.contains(block->second[last]) && stride != module.strides.end()) {
        variable.element_bytes = stride->second;
        variable.elements_at = offset == module.offsets.end() ? 0 : offset->second;
      }
    }
    if (const auto effect = effects.find(id); effect != effects.end() && effect->second != 0) {
      variable.reads = (effect->second & kRead) != 0;
      variable.writes = (effect->second & kWrite) != 0;
      variable.is_atomic = (effect->second & kPlain) == 0;
      variable.reads_without_format =
          (effect->second & kReadImage) != 0 && module.images_without_format.contains(inner);
    }
    found.push_back(std::move(variable));
  }
  std::stable_sort(found.begin(), found.end(), [](const BoundVariable& a, const BoundVariable& b) {
    return std::pair(a.set, a.binding) < std::pair(b.set, b.binding);
  });
  return found;
}

}  // namespace heddle::vulkan::shader
