// SPDX-License-Identifier: Apache-2.0
#include "transform.hpp"

#include <OpenColorIO/OpenColorIO.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <regex>

namespace ocio_display {

namespace ocio = OCIO_NAMESPACE;

namespace {

// Built-in transforms from CIE XYZ with a white of D65 to each display, and from ACES2065-1 to that XYZ for each view.
constexpr std::array kDisplays{"DISPLAY - CIE-XYZ-D65_to_sRGB",
                               "DISPLAY - CIE-XYZ-D65_to_REC.1886-REC.709",
                               "DISPLAY - CIE-XYZ-D65_to_G2.2-REC.709",
                               "DISPLAY - CIE-XYZ-D65_to_REC.1886-REC.2020",
                               "DISPLAY - CIE-XYZ-D65_to_G2.6-P3-D65",
                               "DISPLAY - CIE-XYZ-D65_to_REC.2100-PQ",
                               "DISPLAY - CIE-XYZ-D65_to_REC.2100-HLG-1000nit",
                               "DISPLAY - CIE-XYZ-D65_to_ST2084-P3-D65"};
constexpr std::array<const char*, 9> kViews{
    "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - SDR-VIDEO_1.0",
    "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - SDR-VIDEO-REC709lim_1.1",
    "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - SDR-VIDEO-P3lim_1.1",
    "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - SDR-CINEMA_1.0",
    "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - HDR-VIDEO-1000nit-15nit-REC2020lim_1.1",
    "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - HDR-VIDEO-2000nit-15nit-REC2020lim_1.1",
    "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - HDR-VIDEO-4000nit-15nit-REC2020lim_1.1",
    "ACES-OUTPUT - ACES2065-1_to_CIE-XYZ-D65 - HDR-CINEMA-108nit-7.2nit-P3lim_1.1",
    nullptr};
static_assert(kDisplays.size() + 1 == std::size(kDisplayNames) && kViews.size() + 1 == std::size(kViewNames));
constexpr std::uint32_t kFirstDisplayOf16Bits = 5;
constexpr const char* kGamutCompression = "ACES-LMT - ACES 1.3 Reference Gamut Compression";
constexpr const char* kXyzFromAces = "UTILITY - ACES-AP0_to_CIE-XYZ-D65_BFD";

ocio::ConstTransformRcPtr builtin(const char* style, bool is_inverse = false) {
  const ocio::BuiltinTransformRcPtr made = ocio::BuiltinTransform::Create();
  made->setStyle(style);
  made->setDirection(is_inverse ? ocio::TRANSFORM_DIR_INVERSE : ocio::TRANSFORM_DIR_FORWARD);
  return made;
}

/// Linear Rec.709 to CIE XYZ, white (D65) of Y = 1: from the chromaticities of ITU-R BT.709-6, in float64.
ocio::ConstTransformRcPtr xyz_from_rec709() {
  const ocio::MatrixTransformRcPtr made = ocio::MatrixTransform::Create();
  constexpr std::array<double, 16> kMatrix{0.41239079926595934,
                                           0.35758433938387796,
                                           0.18048078840183429,
                                           0,
                                           0.21263900587151036,
                                           0.71516867876775593,
                                           0.07219231536073371,
                                           0,
                                           0.019330818715591851,
                                           0.11919477979462599,
                                           0.95053215224966058,
                                           0,
                                           0,
                                           0,
                                           0,
                                           1};
  made->setMatrix(kMatrix.data());
  return made;
}

std::string joined(int count, const auto& name_of) {
  std::string text;
  for (int i = 0; i < count; ++i) text += (i == 0 ? "" : ", ") + std::string(name_of(i));
  return text.empty() ? "none" : text;
}

ocio::ConstProcessorRcPtr builtin_processor(const Request& request) {
  const ocio::GroupTransformRcPtr group = ocio::GroupTransform::Create();
  group->appendTransform(xyz_from_rec709()->createEditableCopy());
  const char* const view = kViews.at(request.view);
  if (view != nullptr || request.compresses_gamut) {
    group->appendTransform(builtin(kXyzFromAces, true)->createEditableCopy());
    if (request.compresses_gamut) group->appendTransform(builtin(kGamutCompression)->createEditableCopy());
    group->appendTransform(builtin(view != nullptr ? view : kXyzFromAces)->createEditableCopy());
  }
  group->appendTransform(builtin(kDisplays.at(request.display))->createEditableCopy());
  return ocio::Config::CreateRaw()->getProcessor(group);
}

ocio::ConstProcessorRcPtr config_processor(const Request& request) {
  const ocio::ConstConfigRcPtr config = ocio::Config::CreateFromFile(request.config.c_str());
  const std::string in = "config '" + request.config + "': ";
  if (request.config_source.empty() || config->getColorSpace(request.config_source.c_str()) == nullptr) {
    throw BadRequest(in + "config_source is \"" + request.config_source +
                     "\"; expected the colour space of the config that is linear Rec.709, one of " +
                     joined(config->getNumColorSpaces(), [&](int i) { return config->getColorSpaceNameByIndex(i); }));
  }
  const std::string display = request.config_display.empty() ? config->getDefaultDisplay() : request.config_display;
  const std::string displays = joined(config->getNumDisplays(), [&](int i) { return config->getDisplay(i); });
  const int view_count = config->getNumViews(display.c_str());
  if (view_count == 0) {
    throw BadRequest(in + "config_display is \"" + display + "\"; expected one of " + displays);
  }
  const std::string view = request.config_view.empty() ? config->getDefaultView(display.c_str()) : request.config_view;
  bool has_view = false;
  for (int i = 0; i < view_count; ++i) has_view = has_view || view == config->getView(display.c_str(), i);
  if (!has_view) {
    throw BadRequest(in + "config_view is \"" + view + "\"; display '" + display + "' has " +
                     joined(view_count, [&](int i) { return config->getView(display.c_str(), i); }));
  }
  const ocio::DisplayViewTransformRcPtr transform = ocio::DisplayViewTransform::Create();
  transform->setSrc(request.config_source.c_str());
  transform->setDisplay(display.c_str());
  transform->setView(view.c_str());
  return config->getProcessor(transform);
}

constexpr std::size_t kFloatsPerTexel = 4;

std::string number(double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.9f", value);
  return text.data();
}

std::string call_of(const std::string& sampler) {
  return "sample_" + sampler;
}

/// What stands in for the samplers of the library's text: one function each, by the table's place in the buffer.
std::string declare_2d(const std::string& sampler, std::size_t first, unsigned width, unsigned height, bool is_1d,
                       ocio::Interpolation interpolation) {
  const std::string size = "ivec2(" + std::to_string(width) + ", " + std::to_string(height) + ")";
  const std::string function = interpolation == ocio::INTERP_NEAREST ? "lookup_2d_nearest" : "lookup_2d";
  return "vec4 " + call_of(sampler) + (is_1d ? "(float u) { return " : "(vec2 uv) { return ") + function + "(" +
         std::to_string(first) + ", " + size + (is_1d ? ", vec2(u, 0.5)); }\n" : ", uv); }\n");
}

std::string declare_3d(const std::string& sampler, std::size_t first, unsigned edge,
                       ocio::Interpolation interpolation) {
  const std::string function = interpolation == ocio::INTERP_NEAREST ? "lookup_3d_nearest" : "lookup_3d";
  return "vec4 " + call_of(sampler) + "(vec3 uvw) { return " + function + "(" + std::to_string(first) + ", " +
         std::to_string(edge) + ", uvw); }\n";
}

}  // namespace

struct Transform::Processor {
  ocio::ConstProcessorRcPtr whole;
  ocio::ConstCPUProcessorRcPtr cpu;
};

bool needs_16_bits(std::uint32_t display) {
  return display >= kFirstDisplayOf16Bits;
}

double shape(double exposed) {
  return std::log2(1.0 + exposed / kShaperOffset) / std::log2(1.0 + kShaperLargest / kShaperOffset);
}
double unshape(double position) {
  return kShaperOffset * (std::exp2(position * std::log2(1.0 + kShaperLargest / kShaperOffset)) - 1.0);
}

Transform::Transform(const Request& request) : processor_(std::make_unique<Processor>()) {
  try {
    processor_->whole = request.config.empty() ? builtin_processor(request) : config_processor(request);
    processor_->cpu = processor_->whole->getDefaultCPUProcessor();
    if (request.lut_size == 0) {
      write_text();
    } else if (request.lut_size == 1) {
      throw BadRequest("lut_size is 1; expected 0, for no table, or 2 and more: a table of one node has no cells");
    } else {
      bake(request.lut_size);
    }
  } catch (const ocio::Exception& error) {
    throw BadRequest(std::string("OpenColorIO: ") + error.what());
  }
  if (lookups_.empty()) lookups_.resize(kFloatsPerTexel);
}
Transform::~Transform() = default;
Transform::Transform(Transform&&) noexcept = default;
Transform& Transform::operator=(Transform&&) noexcept = default;

void Transform::apply(std::span<float> rgb) const {
  ocio::PackedImageDesc image(rgb.data(), static_cast<long>(rgb.size() / 3), 1, ocio::CHANNEL_ORDERING_RGB);
  processor_->cpu->apply(image);
}

void Transform::write_text() {
  ocio::GpuShaderDescRcPtr shader = ocio::GpuShaderDesc::CreateShaderDesc();
  shader->setLanguage(ocio::GPU_LANGUAGE_GLSL_4_0);
  shader->setFunctionName("ocio_transform");
  shader->setResourcePrefix("ocio_");
  processor_->whole->getDefaultGPUProcessor()->extractGpuShaderInfo(shader);

  // The library takes roots of differences that rounding makes negative, at greys: NaN, which would be a black pixel.
  std::string tables = "#define sqrt(x) sqrt(max(x, 0.0))\n";
  std::string text = shader->getShaderText();
  const auto replace = [&](const std::string& sampler) {
    text = std::regex_replace(text, std::regex("uniform\\s+sampler\\dD\\s+" + sampler + "\\s*;"), "");
    text =
        std::regex_replace(text, std::regex("texture(\\dD)?\\s*\\(\\s*" + sampler + "\\s*,"), call_of(sampler) + "(");
  };
  for (unsigned i = 0; i < shader->getNumTextures(); ++i) {
    const char* name = nullptr;
    const char* sampler = nullptr;
    unsigned width = 0;
    unsigned height = 0;
    ocio::GpuShaderDesc::TextureType channels = ocio::GpuShaderDesc::TEXTURE_RGB_CHANNEL;
    ocio::Interpolation interpolation = ocio::INTERP_LINEAR;
    shader->getTexture(i, name, sampler, width, height, channels, interpolation);
    const float* values = nullptr;
    shader->getTextureValues(i, values);
    const bool is_1d = text.find(std::string("sampler1D ") + sampler) != std::string::npos;
    tables += declare_2d(sampler, lookups_.size() / kFloatsPerTexel, width, height, is_1d, interpolation);
    replace(sampler);
    const std::size_t components = channels == ocio::GpuShaderDesc::TEXTURE_RED_CHANNEL ? 1 : 3;
    for (std::size_t texel = 0; texel < std::size_t{width} * height; ++texel) {
      for (std::size_t c = 0; c < kFloatsPerTexel; ++c) {
        lookups_.push_back(c < components ? values[texel * components + c] : 0.0F);
      }
    }
  }
  for (unsigned i = 0; i < shader->getNum3DTextures(); ++i) {
    const char* name = nullptr;
    const char* sampler = nullptr;
    unsigned edge = 0;
    ocio::Interpolation interpolation = ocio::INTERP_LINEAR;
    shader->get3DTexture(i, name, sampler, edge, interpolation);
    const float* values = nullptr;
    shader->get3DTextureValues(i, values);
    tables += declare_3d(sampler, lookups_.size() / kFloatsPerTexel, edge, interpolation);
    replace(sampler);
    for (std::size_t texel = 0; texel < std::size_t{edge} * edge * edge; ++texel) {
      lookups_.insert(lookups_.end(), {values[texel * 3], values[texel * 3 + 1], values[texel * 3 + 2], 0.0F});
    }
  }
  glsl_ = tables + text;
}

void Transform::bake(std::uint32_t size) {
  std::vector<float> row(std::size_t{size} * 3);
  for (std::uint32_t z = 0; z < size; ++z) {
    for (std::uint32_t y = 0; y < size; ++y) {
      for (std::uint32_t x = 0; x < size; ++x) {
        row[3 * x] = static_cast<float>(unshape(x / (size - 1.0)));
        row[3 * x + 1] = static_cast<float>(unshape(y / (size - 1.0)));
        row[3 * x + 2] = static_cast<float>(unshape(z / (size - 1.0)));
      }
      apply(row);
      for (std::uint32_t x = 0; x < size; ++x) {
        lookups_.insert(lookups_.end(), {row[3 * x], row[3 * x + 1], row[3 * x + 2], 0.0F});
      }
    }
  }
  const double scale = (size - 1.0) / std::log2(1.0 + kShaperLargest / kShaperOffset);
  glsl_ = "vec4 ocio_transform(vec4 exposed) {\n  vec3 at = " + number(scale) + " * log2(1.0 + exposed.rgb * " +
          number(1.0 / kShaperOffset) + ");\n  return vec4(lookup_tetrahedral(0, " + std::to_string(size) +
          ", clamp(at, vec3(0.0), vec3(" + std::to_string(size - 1) + ".0))), exposed.a);\n}\n";
}

}  // namespace ocio_display
