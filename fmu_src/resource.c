#include "resource.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _WIN32
#include <windows.h>
#endif

enum { LARGEST_FILE = 1 << 26 }; /* bytes; a model image of the largest finger is far below */

/* value of a hexadecimal digit, -1 for anything else */
static int hex_digit(char c) {
  static const char digits[] = "0123456789abcdef0123456789ABCDEF";
  const char* at = c ? strchr(digits, c) : NULL;
  return at ? (int)(at - digits) % 16 : -1;
}

/* A percent sign before anything but two digits stands for itself: some importers do not encode. */
static void decode_percent(char* text) {
  char* to = text;
  for (const char* from = text; *from; ++from) {
    const int high = *from == '%' ? hex_digit(from[1]) : -1;
    const int low = high >= 0 ? hex_digit(from[2]) : -1;
    if (low >= 0 && high + low > 0) {
      *to++ = (char)(high * 16 + low);
      from += 2;
    } else {
      *to++ = *from;
    }
  }
  *to = '\0';
}

static int starts_with(const char* text, const char* lower_case) {
  for (; *lower_case; ++text, ++lower_case) {
    const char c = *text >= 'A' && *text <= 'Z' ? (char)(*text - 'A' + 'a') : *text;
    if (c != *lower_case) {
      return 0;
    }
  }
  return 1;
}

/* Turns a file URI into a path in place and returns where it starts. A host other than localhost stays: //server/x. */
static char* path_of_uri(char* uri, int decode) {
  char* path = uri + strlen("file:");
  if (decode) {
    decode_percent(path);
  }
  if (starts_with(path, "///")) {
    path += 2;
  } else if (starts_with(path, "//localhost/")) {
    path += strlen("//localhost");
  }
#ifdef _WIN32
  if (path[0] == '/' && path[1] && path[2] == ':') { /* /C:/x */
    ++path;
  }
#endif
  return path;
}

static FILE* open_file(const char* path) {
#ifdef _WIN32
  const int length = MultiByteToWideChar(CP_UTF8, 0, path, -1, NULL, 0);
  wchar_t* wide = length > 0 ? malloc((size_t)length * sizeof(wchar_t)) : NULL;
  FILE* file = NULL;
  if (wide && MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, length) > 0) {
    file = _wfopen(wide, L"rb");
  }
  free(wide);
  return file;
#else
  return fopen(path, "rb");
#endif
}

static void* read_all(FILE* file, size_t* size, log_text* reason) {
  size_t capacity = 1 << 14, used = 0;
  char* block = malloc(capacity);
  while (block) {
    used += fread(block + used, 1, capacity - used, file);
    if (used < capacity) {
      break;
    }
    capacity *= 2;
    char* larger = capacity > LARGEST_FILE ? NULL : realloc(block, capacity);
    if (!larger) {
      free(block);
    }
    block = larger;
  }
  if (!block) {
    *reason = log_line("file too large for the memory");
    return NULL;
  }
  if (ferror(file) || used == 0) {
    *reason = log_line("cannot be read, or is empty");
    free(block);
    return NULL;
  }
  *size = used;
  return block;
}

/* folder and file name in one block for free() */
static char* join(const char* folder, const char* name) {
  const size_t length = strlen(folder), room = strlen(name) + 2;
  char* path = malloc(length + room);
  if (path) {
    snprintf(path, length + room, "%s%s%s", folder, length && folder[length - 1] == '/' ? "" : "/", name);
  }
  return path;
}

static FILE* open_in(const char* location, const char* name, int is_uri, int decode) {
  char* path = join(location, name);
  FILE* file = path ? open_file(is_uri ? path_of_uri(path, decode) : path) : NULL;
  free(path);
  return file;
}

void* resource_read(const char* location, const char* name, size_t* size, const char* argument, log_text* reason) {
  if (!location || !*location) {
    *reason = log_line("%s is NULL or empty: expected where the folder resources is", argument);
    return NULL;
  }
  const int is_uri = starts_with(location, "file:");
  if (!is_uri && strstr(location, "://")) {
    *reason = log_line("%s: expected a file URI, file:///..., or a path", argument);
    return NULL;
  }
  FILE* file = open_in(location, name, is_uri, 1);
  if (!file && is_uri) { /* its writer may not have encoded it */
    file = open_in(location, name, is_uri, 0);
  }
  if (!file) {
    *reason = log_line("not found in the folder that %s names", argument);
    return NULL;
  }
  void* block = read_all(file, size, reason);
  fclose(file);
  return block;
}
