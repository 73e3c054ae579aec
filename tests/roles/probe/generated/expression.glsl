// SPDX-License-Identifier: Apache-2.0
// Where no text is set.
float expression(float x) { return -1.0; }
