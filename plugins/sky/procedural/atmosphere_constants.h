// SPDX-License-Identifier: Apache-2.0
// The Earth's clear air, for C++ and GLSL. Kilometres; red, green, blue stand for 680, 550 and 440 nm.
// Source  Bruneton and Neyret 2008, "Precomputed Atmospheric Scattering"; Hillaire 2020, "A Scalable and Production
// Ready
//         Sky and Atmosphere Rendering Technique", table 1
#ifndef HEDDLE_SKY_ATMOSPHERE_CONSTANTS_H
#define HEDDLE_SKY_ATMOSPHERE_CONSTANTS_H

#define SKY_GROUND_RADIUS 6360.0
#define SKY_THICKNESS 100.0  // of the air that is looked at; its density at the top is 4e-6 of that at the ground
// Rayleigh: molecules. 1/km at the ground, and the height in which their number falls to 1/e.
#define SKY_RAYLEIGH_R 5.802e-3
#define SKY_RAYLEIGH_G 13.558e-3
#define SKY_RAYLEIGH_B 33.1e-3
#define SKY_RAYLEIGH_HEIGHT 8.0
// Mie: haze of a clear day; times the parameter mie_density.
#define SKY_MIE_SCATTERING 3.996e-3
#define SKY_MIE_EXTINCTION 8.396e-3
#define SKY_MIE_HEIGHT 1.2
#define SKY_MIE_ANISOTROPY 0.8
// Ozone absorbs only: most at 25 km, none 15 km above and below.
#define SKY_OZONE_R 0.650e-3
#define SKY_OZONE_G 1.881e-3
#define SKY_OZONE_B 0.085e-3
#define SKY_OZONE_CENTRE 25.0
#define SKY_OZONE_HALF_WIDTH 15.0
// The sun's angular radius, radians: 696,340 km seen from 149.6e6 km.
#define SKY_SUN_RADIUS 0.00465

#endif
