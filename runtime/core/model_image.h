/* The model image: a finger as a flat block of numbers, version 1, little-endian.
 *
 *   offset  0  8 bytes   "TFMUIMG" and a zero
 *           8  u32       version = 1
 *          12  u32       0
 *          16  u64       size of the whole block in bytes, a multiple of 8
 *          24  u64       checksum of all that follows (hash_bytes, seed 0)
 *          32  u32       n joints, 1..16
 *          36  u32       m tendons, 1..64
 *          40  u32       option bits (MODEL_HAS_*)
 *          44  u32       w, number of shape words
 *          48  u32       e, number of extensions, 0..1024
 *          52  u32       p, number of parameters
 *          56  u32[w]    shape words: which friction exists (below)
 *              u32[4·e]  table of extensions: effect id, joint (1..n) or 0, tendon (1..m) or 0, level (1..n) or 0
 *              zeros up to a multiple of 8
 *              f64[p]    parameter values in canonical order (model_item)
 *
 * Shape words   a joint    bit 0 cover, bits 1-2 friction (law_kind), bits 3-4 load_friction
 *               a tendon   bit 0 bidirectional; then n words: pulley_friction (the last is LAW_ABSENT);
 *                          then for each of n edges: points K, bit 31 where it has angles; K words law_kind */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "effect.h"
#include "key_table.h" /* the kinds of items, and the largest numbers of things */
#include "message.h"

enum {
  MODEL_VERSION = 1,
  MODEL_HEADER_BYTES = 56,
  MODEL_EXTENSION_WORDS = 4,
  MODEL_MAX_ELEMENTS = 2 /* rows of presliding at one place */
};

#define MODEL_EDGE_HAS_ANGLES 0x80000000u

typedef enum law_kind { LAW_ABSENT, LAW_SYMMETRIC, LAW_ASYMMETRIC } law_kind;

/* What exists on a finger; the numbers are kept apart. words and extensions are in the host's byte order. */
typedef struct model_shape {
  uint32_t joints, tendons, options;
  uint32_t word_count, extension_count, parameter_count;
  const uint32_t* words;
  const uint32_t* extensions;
  /* filled by model_read_header(): what the memory of a finger depends on */
  uint32_t edge_count, edge_law_count;    /* edges with friction, their laws */
  uint32_t most_points[MODEL_MAX_JOINTS]; /* largest number of working points before each joint; 0 without angles */
  uint32_t elements;                      /* most rows of presliding at one place: 0..MODEL_MAX_ELEMENTS */
  int stretches;                          /* 1: with cord_stretch */
  size_t extension_memory;                /* all that the extensions remember */
} model_shape;

/* Some parameters that belong together. */
typedef struct model_item {
  model_item_kind kind;
  uint32_t first, count; /* parameter indices first .. first + count − 1 */
  uint32_t joint;        /* 0-based; of pulleys and edges: the position in the list */
  uint32_t tendon;       /* 0-based */
  uint32_t point;        /* working point or band, 0-based */
  int has_angles;        /* the edge is a list of working points */
  int bidirectional;     /* the tendon; of its stiffness */
  law_kind law;          /* of laws */
  uint32_t extension;    /* 0-based */
  effect_place place;    /* of an extension */
  const effect_type* effect;
} model_item;

/* Calls visit for each item in order; stops at the first result other than 0 and returns it. */
int model_visit(const model_shape* shape, int (*visit)(void* context, const model_item* item), void* context);

/* Where row `index` of the extensions acts, and how many numbers an effect remembers there. */
effect_place model_extension_place(const model_shape* shape, uint32_t index);
size_t model_extension_memory(const effect_type* effect, const model_shape* shape, effect_place place);

/* Numbers of a law of this kind: 0, 4 or 8. */
uint32_t model_law_count(law_kind kind);

/* Checks header, sizes, checksum and shape where they stand, and fills all counts of shape; words and extensions stay
 * NULL. Returns 0, or −1 with one line in message. */
int model_read_header(const void* image, size_t image_size, model_shape* shape, message_line message);

/* Copies what a checked header announces.
 *   words         [word_count + 4·extension_count] receives shape words and extensions in the host's order
 *   values        [parameter_count] receives the values, unchecked (parameters.h checks them) */
int model_read_body(const void* image, model_shape* shape, uint32_t* words, double* values, message_line message);

/* Number of parameters that the shape words ask for; sets parameter_count where the shape is built by hand. */
uint32_t model_count_parameters(const model_shape* shape);

/* Size in bytes of an image of this shape. */
size_t model_image_size(const model_shape* shape);

/* Writes an image [model_image_size] from a shape and its values [parameter_count]. */
void model_write(const model_shape* shape, const double* values, void* image);
