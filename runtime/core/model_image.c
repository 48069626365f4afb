#include "model_image.h"

#include "effect_facts.h"

#include <string.h>

#include "bytes.h"

static const char magic[8] = "TFMUIMG";

uint32_t model_law_count(law_kind kind) {
  return kind == LAW_ABSENT ? 0 : kind == LAW_SYMMETRIC ? 4 : 8;
}

/* --- walking over the items ------------------------------------------------------------------------------------- */

typedef struct walk {
  const model_shape* shape;
  int (*visit)(void* context, const model_item* item); /* NULL: only count */
  void* context;
  model_item item; /* what the next ones have in common */
  uint32_t next;   /* parameter index */
  int result;
} walk;

/* passes on one item unless it has no numbers or an earlier visit has ended the walk */
static void emit(walk* w, model_item_kind kind, uint32_t count) {
  w->item.kind = kind;
  w->item.first = w->next;
  w->item.count = count;
  w->next += count;
  if (count && w->visit && w->result == 0) {
    w->result = w->visit(w->context, &w->item);
  }
}

static void emit_law(walk* w, model_item_kind kind, uint32_t law) {
  w->item.law = (law_kind)law;
  emit(w, kind, model_law_count(w->item.law));
  w->item.law = LAW_ABSENT;
}

static void walk_joint(walk* w, uint32_t joint) {
  const uint32_t word = w->shape->words[joint];
  w->item = (model_item){.joint = joint};
  emit(w, ITEM_COVER, word & 1 ? 2 : 0);
  emit_law(w, ITEM_JOINT_FRICTION, word >> 1 & 3);
  emit_law(w, ITEM_LOAD_FRICTION, word >> 3 & 3);
}

static const uint32_t* walk_edge(walk* w, const uint32_t* word) {
  model_item* item = &w->item;
  const uint32_t points = *word & ~MODEL_EDGE_HAS_ANGLES;
  item->has_angles = (*word++ & MODEL_EDGE_HAS_ANGLES) != 0;
  emit(w, ITEM_EDGE_ANGLES, item->has_angles ? points : 0);
  for (item->point = 0; item->point < points; ++item->point) {
    emit_law(w, ITEM_EDGE_FRICTION, *word++);
  }
  item->point = 0;
  return word;
}

static const uint32_t* walk_tendon(walk* w, uint32_t tendon, const uint32_t* word) {
  const uint32_t n = w->shape->joints;
  w->item = (model_item){.tendon = tendon, .bidirectional = *word++ & 1};
  emit(w, ITEM_STIFFNESS, 1);
  emit(w, ITEM_MOMENT_ARMS, n);
  emit(w, ITEM_TENDON_ZERO, w->shape->options & MODEL_HAS_TENDON_ZERO ? 1 : 0);
  for (w->item.joint = 0; w->item.joint < n; ++w->item.joint) {
    emit_law(w, ITEM_PULLEY_FRICTION, *word++);
  }
  for (w->item.joint = 0; w->item.joint < n; ++w->item.joint) {
    word = walk_edge(w, word);
  }
  return word;
}

/* numbers of an item of the finger as a whole; 0 where the description has none */
static uint32_t count_of(const model_shape* shape, model_item_kind kind) {
  const key_row* row = key_row_of(kind, 0);
  if ((shape->options & row->option) != row->option) {
    return 0;
  }
  switch (row->count) {
    case KEY_PER_JOINT: return shape->joints;
    case KEY_THREE: return 3;
    default: return 1;
  }
}

static void walk_finger(walk* w) {
  model_item* item = &w->item;
  for (model_item_kind kind = ITEM_EDGE_FRICTION + 1; kind < ITEM_EXTENSION; ++kind) {
    const uint32_t count = count_of(w->shape, kind);
    *item = (model_item){.kind = kind};
    if (kind >= ITEM_BAND_NOISE && kind <= ITEM_BAND_FRICTION_RESERVE) {
      for (; item->point < MODEL_MAX_BANDS; ++item->point) {
        emit(w, kind, count);
      }
    } else if (kind == ITEM_LINK_AXIS) { /* the offsets with them */
      for (; item->joint < w->shape->joints; ++item->joint) {
        emit(w, ITEM_LINK_AXIS, count);
        emit(w, ITEM_LINK_OFFSET, count);
      }
    } else if (kind != ITEM_LINK_OFFSET) {
      emit(w, kind, count);
    }
  }
}

static uint32_t place_at(uint32_t number) {
  return number ? number - 1 : EFFECT_NOWHERE;
}

effect_place model_extension_place(const model_shape* shape, uint32_t index) {
  const uint32_t* row = shape->extensions + (size_t)index * MODEL_EXTENSION_WORDS;
  return (effect_place){place_at(row[1]), place_at(row[2]), place_at(row[3])};
}

size_t model_extension_memory(const effect_type* effect, const model_shape* shape, effect_place place) {
  const effect_action* action = effect->action;
  return action->state_count ? action->state_count(shape->joints, shape->tendons, place) : action->memory_count;
}

static void walk_extension(walk* w, uint32_t index) {
  const effect_type* effect = effect_by_id(w->shape->extensions[(size_t)index * MODEL_EXTENSION_WORDS]);
  w->item = (model_item){.extension = index, .effect = effect, .place = model_extension_place(w->shape, index)};
  emit(w, ITEM_EXTENSION, effect->parameter_count);
}

static uint32_t run_walk(walk* w) {
  const model_shape* shape = w->shape;
  const uint32_t* word = shape->words + shape->joints;
  for (uint32_t j = 0; j < shape->joints; ++j) {
    walk_joint(w, j);
  }
  for (uint32_t i = 0; i < shape->tendons; ++i) {
    word = walk_tendon(w, i, word);
  }
  walk_finger(w);
  for (uint32_t i = 0; i < shape->extension_count; ++i) {
    walk_extension(w, i);
  }
  return w->next;
}

int model_visit(const model_shape* shape, int (*visit)(void* context, const model_item* item), void* context) {
  walk w = {.shape = shape, .visit = visit, .context = context};
  run_walk(&w);
  return w.result;
}

uint32_t model_count_parameters(const model_shape* shape) {
  walk w = {.shape = shape};
  return run_walk(&w);
}

/* --- reading ---------------------------------------------------------------------------------------------------- */

/* "<what> <value>, expected <expectation>" */
static int refuse_value(message_line message, const char* what, size_t value, const char* expectation) {
  return message_write(message, "%s %zu, expected %s", what, value, expectation);
}

static uint64_t unpadded_size(const model_shape* shape) {
  return MODEL_HEADER_BYTES +
         4u * ((uint64_t)shape->word_count + (uint64_t)MODEL_EXTENSION_WORDS * shape->extension_count);
}

static uint64_t values_offset(const model_shape* shape) {
  return (unpadded_size(shape) + 7u) & ~(uint64_t)7u;
}

static int read_counts(const void* image, size_t image_size, model_shape* shape, message_line message) {
  const unsigned char* bytes = image;
  if (!image || image_size < MODEL_HEADER_BYTES || memcmp(bytes, magic, sizeof magic) != 0) {
    return message_write(message, "not a model image: it does not begin with \"TFMUIMG\"");
  }
  if (load_u32(bytes + 8) != MODEL_VERSION) {
    return refuse_value(message, "model image of version", load_u32(bytes + 8), "1");
  }
  if (load_u32(bytes + 12) != 0) {
    return message_write(message, "damaged model image: its reserved bytes are not zero");
  }
  if (load_u64(bytes + 16) != image_size) {
    return message_write(message, "model image cut off: its size is not the one in its header");
  }
  if (load_u64(bytes + 24) != hash_bytes(bytes + 32, image_size - 32, 0)) {
    return message_write(message, "damaged model image: its checksum does not match");
  }
  *shape = (model_shape){.joints = load_u32(bytes + 32),
                         .tendons = load_u32(bytes + 36),
                         .options = load_u32(bytes + 40),
                         .word_count = load_u32(bytes + 44),
                         .extension_count = load_u32(bytes + 48),
                         .parameter_count = load_u32(bytes + 52)};
  if (shape->joints < 1 || shape->joints > MODEL_MAX_JOINTS) {
    return refuse_value(message, "model image: joints", shape->joints, "1 to 16");
  }
  if (shape->tendons < 1 || shape->tendons > MODEL_MAX_TENDONS) {
    return refuse_value(message, "model image: tendons", shape->tendons, "1 to 64");
  }
  if (shape->extension_count > MODEL_MAX_EXTENSIONS) {
    return refuse_value(message, "model image: extensions", shape->extension_count, "at most 1024");
  }
  if (shape->options & ~(uint32_t)MODEL_OPTION_BITS) {
    return refuse_value(message, "model image: option bits", shape->options, "a sum of known ones");
  }
  if (shape->options & ~(uint32_t)(TENDONFMU_OPTIONS)) {
    return refuse_value(message, "model image: option bits", shape->options, "none beyond TENDONFMU_OPTIONS");
  }
  if ((shape->options & (MODEL_DETECTS_BY_BANDS | MODEL_WATCHES_MOTORS)) == MODEL_WATCHES_MOTORS) {
    return refuse_value(message, "model image: option bits", shape->options, "ones that go together");
  }
  if (values_offset(shape) + 8u * (uint64_t)shape->parameter_count != image_size) {
    return message_write(message, "model image whose counts do not add up to its size");
  }
  return 0;
}

/* a checked walk over the shape words as they stand in the image */
typedef struct word_reader {
  const unsigned char* bytes;
  uint32_t left;
  int overrun;
} word_reader;

static uint32_t next_word(word_reader* r) {
  if (r->left == 0) {
    r->overrun = 1;
    return 0;
  }
  const uint32_t word = load_u32(r->bytes);
  r->bytes += 4;
  r->left -= 1;
  return word;
}

static int check_edge(word_reader* r, model_shape* shape, uint32_t joint) {
  const uint32_t word = next_word(r), points = word & ~MODEL_EDGE_HAS_ANGLES;
  const int has_angles = (word & MODEL_EDGE_HAS_ANGLES) != 0;
  if (points > MODEL_MAX_POINTS || (has_angles ? points == 0 : points > 1)) {
    return -1;
  }
  for (uint32_t k = 0; k < points; ++k) {
    const uint32_t kind = next_word(r);
    if (kind != LAW_SYMMETRIC && kind != LAW_ASYMMETRIC) {
      return -1;
    }
  }
  shape->edge_count += points > 0;
  shape->edge_law_count += points;
  if (has_angles && points > shape->most_points[joint]) {
    shape->most_points[joint] = points;
  }
  return 0;
}

static int check_tendon(word_reader* r, model_shape* shape) {
  if (next_word(r) > 1) {
    return -1;
  }
  for (uint32_t j = 0; j < shape->joints; ++j) {
    const uint32_t last_allowed = j + 1 == shape->joints ? LAW_ABSENT : LAW_ASYMMETRIC;
    if (next_word(r) > last_allowed) {
      return -1;
    }
  }
  for (uint32_t j = 0; j < shape->joints; ++j) {
    if (check_edge(r, shape, j)) {
      return -1;
    }
  }
  return 0;
}

static int check_shape(const unsigned char* words, model_shape* shape, message_line message) {
  word_reader r = {words, shape->word_count, 0};
  for (uint32_t j = 0; j < shape->joints; ++j) {
    const uint32_t word = next_word(&r);
    if (word > 31 || (word >> 1 & 3) == 3 || word >> 3 == 3) {
      return message_write(message, "model image with a damaged shape: joints");
    }
  }
  for (uint32_t i = 0; i < shape->tendons; ++i) {
    if (check_tendon(&r, shape)) {
      return message_write(message, "model image with a damaged shape: tendons");
    }
  }
  return r.overrun || r.left ? message_write(message, "model image with a damaged shape: number of words") : 0;
}

static int place_is_sound(const effect_type* effect, const model_shape* shape, const uint32_t place[3]) {
  const uint32_t joint = place[0], tendon = place[1], level = place[2];
  const int at_joint = joint != 0, at_tendon = tendon != 0;
  if (joint > shape->joints || tendon > shape->tendons || level > shape->joints || (level && !effect->level) ||
      (effect->joint == PLACE_REFUSED && at_joint) || (effect->joint == PLACE_REQUIRED && !at_joint) ||
      (effect->tendon == PLACE_REFUSED && at_tendon) || (effect->tendon == PLACE_REQUIRED && !at_tendon)) {
    return 0;
  }
  switch (effect->rule) {
    case PLACES_EXACTLY_ONE: return at_joint != at_tendon;
    case PLACES_AT_MOST_ONE: return !(at_joint && at_tendon);
    case PLACES_NOT_LAST_JOINT: return joint < shape->joints;
    case PLACES_LEVEL_ALONE: return !level || !(at_joint || at_tendon);
    default: return 1;
  }
}

/* rows of the table before the i-th, and it, that are the same */
static uint32_t same_rows(const unsigned char* table, uint32_t i) {
  const size_t size = 4 * MODEL_EXTENSION_WORDS;
  uint32_t same = 1;
  for (uint32_t k = 0; k < i; ++k) {
    same += memcmp(table + k * size, table + i * size, size) == 0;
  }
  return same;
}

static effect_place stored_place(const unsigned char* row) {
  return (effect_place){place_at(load_u32(row + 4)), place_at(load_u32(row + 8)), place_at(load_u32(row + 12))};
}

static int check_extension(const unsigned char* table, uint32_t i, model_shape* shape, message_line message) {
  const unsigned char* row = table + 4 * MODEL_EXTENSION_WORDS * (size_t)i;
  const effect_type* effect = effect_by_id(load_u32(row));
  const uint32_t place[3] = {load_u32(row + 4), load_u32(row + 8), load_u32(row + 12)};
  if (!effect) {
    return refuse_value(message, "model image: effect number", load_u32(row), "one that this version knows");
  }
  if (!effect->action) {
    return message_write(message, "model image with %s, which is not linked: expected bit %zu in TENDONFMU_EFFECTS",
                         effect->name, (size_t)effect->id);
  }
  if (!place_is_sound(effect, shape, place)) {
    return refuse_value(message, "model image: joint of an extension", place[0], "a place where such an effect can be");
  }
  const uint32_t same = effect->most ? same_rows(table, i) : 0;
  if (same > (uint32_t)effect->most) {
    return message_write(message, "model image with more extensions of one effect at a place than that may have");
  }
  if (effect->action == &presliding_action && same > shape->elements) {
    shape->elements = same;
  }
  shape->stretches |= effect->action == &cord_stretch_action;
  shape->extension_memory += model_extension_memory(effect, shape, stored_place(row));
  return 0;
}

static int check_extensions(const unsigned char* image, model_shape* shape, message_line message) {
  const unsigned char* table = image + MODEL_HEADER_BYTES + 4u * (size_t)shape->word_count;
  for (uint32_t i = 0; i < shape->extension_count; ++i) {
    if (check_extension(table, i, shape, message)) {
      return -1;
    }
  }
  return 0;
}

int model_read_header(const void* image, size_t image_size, model_shape* shape, message_line message) {
  if (read_counts(image, image_size, shape, message)) {
    return -1;
  }
  return check_shape((const unsigned char*)image + MODEL_HEADER_BYTES, shape, message) ||
                 check_extensions(image, shape, message)
             ? -1
             : 0;
}

int model_read_body(const void* image, model_shape* shape, uint32_t* words, double* values, message_line message) {
  const unsigned char* bytes = (const unsigned char*)image + MODEL_HEADER_BYTES;
  const uint32_t count = shape->word_count + MODEL_EXTENSION_WORDS * shape->extension_count;
  for (uint32_t i = 0; i < count; ++i) {
    words[i] = load_u32(bytes + 4u * (size_t)i);
  }
  shape->words = words;
  shape->extensions = words + shape->word_count;
  if (model_count_parameters(shape) != shape->parameter_count) {
    return refuse_value(message, "model image: parameters", shape->parameter_count, "as many as its shape has");
  }
  load_doubles(values, (const unsigned char*)image + values_offset(shape), shape->parameter_count);
  return 0;
}

/* --- writing ------------------------------------------------------------------------------------------------------ */

size_t model_image_size(const model_shape* shape) {
  return (size_t)(values_offset(shape) + 8u * (uint64_t)shape->parameter_count);
}

void model_write(const model_shape* shape, const double* values, void* image) {
  unsigned char* bytes = image;
  const size_t size = model_image_size(shape);
  const uint32_t counts[] = {shape->joints,     shape->tendons,         shape->options,
                             shape->word_count, shape->extension_count, shape->parameter_count};
  memset(bytes, 0, size);
  memcpy(bytes, magic, sizeof magic);
  store_u32(bytes + 8, MODEL_VERSION);
  store_u64(bytes + 16, size);
  for (size_t i = 0; i < 6; ++i) {
    store_u32(bytes + 32 + 4 * i, counts[i]);
  }
  unsigned char* to = bytes + MODEL_HEADER_BYTES;
  for (uint32_t i = 0; i < shape->word_count; ++i, to += 4) {
    store_u32(to, shape->words[i]);
  }
  for (uint32_t i = 0; i < MODEL_EXTENSION_WORDS * shape->extension_count; ++i, to += 4) {
    store_u32(to, shape->extensions[i]);
  }
  store_doubles(bytes + values_offset(shape), values, shape->parameter_count);
  store_u64(bytes + 24, hash_bytes(bytes + 32, size - 32, 0));
}
