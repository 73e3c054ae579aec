// SPDX-License-Identifier: Apache-2.0
// Stands in for the text that OpenColorIO writes when a graph is prepared: the same function, changing nothing.

// Exposed linear Rec.709, [0, 65504] -> display colour; alpha is passed on.
vec4 ocio_transform(vec4 exposed) { return exposed; }
