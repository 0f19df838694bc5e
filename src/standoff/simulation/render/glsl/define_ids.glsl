#define IDS
